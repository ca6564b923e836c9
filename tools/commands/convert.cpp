// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <iostream>
#include <memory>
#include <string>

#include "physics/failure.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/recording.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/recording_import.h"
#include "tools/command_line/recording_output.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

struct Arguments {
  std::string in;
  std::string out;
  std::string format;
  bool import = false;
  ImportOptions columns;
};

int run(const Arguments& arguments, const Outputs& outputs) {
  const protocol::Recording recording =
      recording_from(arguments.in, arguments.columns, arguments.import);
  if (arguments.out == "-") {
    if (arguments.format == "lcm") {
      throw InputError(
          Problem{"-", 0, 0, "only CSV can be written to standard output: expected a file"});
    }
    protocol::write_csv(recording, std::cout);
    if (!std::cout.flush()) throw Failure("standard output cannot be written");
    return 0;
  }
  terminal::Progress progress("writing " + arguments.out);
  write_recording(outputs, recording, arguments.out, arguments.format,
                  [&progress](double share) { progress.at(share); });
  progress.finish();
  const double seconds = recording.frames.back().time_s() - recording.frames.front().time_s();
  terminal::print("%s: %s, %.3f s\n", arguments.out.c_str(),
                  physics::counted(recording.frames.size(), "frame").c_str(), seconds);
  return 0;
}

}  // namespace

void add_convert(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("convert", "Convert a recording to CSV or to an LCM event log");
  add_recording(*command, arguments->in);
  add_output(*command, "OUT", arguments->out,
             "Output: .csv or .log; \"-\" is CSV on standard output")
      ->required()
      ->type_name("FILE");
  command->add_option("--format", arguments->format, "Format of OUT, regardless of its name")
      ->check(one_of({"csv", "lcm"}));
  command->add_flag(
      "--import", arguments->import,
      "RECORDING is a CSV file of another program: separators, decimal sign, columns and "
      "units are guessed, and said");
  add_import_options(*command, arguments->columns);
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(*command, {.examples = {{"Convert a log to CSV", "stickslip convert run.log run.csv"},
                                   {"Pipe it into another program", "stickslip convert run.log -"},
                                   {"Import the file of another program",
                                    "stickslip convert --import export.csv run.csv"}},
                      .files = {recording_files},
                      .see_also = {"stickslip-log(1)"}});
}

}  // namespace stickslip::commands
