#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <string>

#include "physics/failure.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/recording.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/recording_input.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;

namespace {

constexpr std::size_t frames_per_block = 10;

struct Arguments {
  std::string in;
  std::string out;
  std::string format;
};

void write_as_csv(const protocol::Recording& recording, const std::string& path,
                  const protocol::ProgressCallback& done) {
  std::ofstream out(path, std::ios::binary);
  if (out) protocol::write_csv(recording, out, done);
  out.close();
  if (!out) {
    throw InputError(
        Problem{path, 0, 0, "cannot be written; does its folder exist, and is the disk full?"});
  }
}

int run(const Arguments& arguments) {
  const protocol::Recording recording = recording_from(arguments.in);
  if (arguments.out == "-") {
    if (arguments.format == "lcm") {
      throw InputError(
          Problem{"-", 0, 0, "only CSV can be written to standard output: expected a file"});
    }
    protocol::write_csv(recording, std::cout);
    if (!std::cout.flush()) throw Failure("standard output cannot be written");
    return 0;
  }
  // IN has been read completely, so IN and OUT may be the same file.
  terminal::Progress progress("writing " + arguments.out);
  const protocol::ProgressCallback done = [&progress](double share) { progress.at(share); };
  if (arguments.format == "csv") {
    write_as_csv(recording, arguments.out, done);
  } else if (arguments.format == "lcm") {
    protocol::write_log(recording, arguments.out, frames_per_block, done);
  } else {
    protocol::write_recording(recording, arguments.out, done);
  }
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
  command
      ->add_option("OUT", arguments->out, "Output: .csv or .log; \"-\" is CSV on standard output")
      ->required()
      ->type_name("FILE");
  command->add_option("--format", arguments->format, "Format of OUT, regardless of its name")
      ->check(one_of({"csv", "lcm"}));
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
  describe(*command, {.examples = {{"Convert a log to CSV", "stickslip convert run.log run.csv"},
                                   {"Pipe it into another program", "stickslip convert run.log -"}},
                      .files = {recording_files},
                      .see_also = {"stickslip-log(1)"}});
}

}  // namespace stickslip::commands
