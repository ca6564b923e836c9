// SPDX-License-Identifier: Apache-2.0
// `stickslip manual`: manual pages of all commands, generated from the parser.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include "physics/failure.h"
#include "physics/number_text.h"
#include "tools/command_line/file_options.h"
#include "tools/commands/commands.h"
#include "tools/files/outputs.h"
#include "tools/files/write_file.h"
#include "tools/terminal/command_tree.h"
#include "tools/terminal/manual_page.h"
#include "tools/terminal/page.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

/// Throws Failure if the parser refuses an example.
void check_examples(CLI::App& app, const terminal::Notes& notes) {
  for (const terminal::Notes::Example& each : notes.examples) {
    if (!each.command.starts_with("stickslip ")) continue;
    try {
      app.clear();
      app.parse(each.command, true);
    } catch (const CLI::ParseError& error) {
      throw Failure("the manual's example `" + each.command + "` is invalid: " + error.what());
    }
  }
}

int run(Program& program, const std::filesystem::path& folder, const Outputs& outputs) {
  make_folder(folder);
  const terminal::Heading heading{"stickslip", 1, STICKSLIP_VERSION, terminal::build_date()};
  const std::string exit_status = terminal::exit_status_of(program);
  const auto write = [&](const CLI::App& command, const terminal::Notes& notes) {
    outputs.write(folder / (terminal::page_name(command, heading) + ".1"), Form::plain,
                  terminal::page(command, heading, notes, exit_status));
  };
  const auto commands = terminal::visible_subcommands(program);
  write(program, program.notes(program));
  for (const CLI::App* command : commands) {
    terminal::Notes notes = program.notes(*command);
    notes.see_also.insert(notes.see_also.begin(), "stickslip(1)");
    write(*command, notes);
  }
  check_examples(program, program.notes(program));
  for (const CLI::App* command : commands) check_examples(program, program.notes(*command));
  terminal::print("%s: %s\n", folder.c_str(),
                  physics::counted(commands.size() + 1, "page").c_str());
  return 0;
}

}  // namespace

void add_manual(CLI::App& app, Action& action) {
  auto folder = std::make_shared<std::string>();
  CLI::App* command =
      app.add_subcommand("manual", "Write the manual pages of these commands into a folder");
  add_output_folder(*command, "DIR", *folder, "Folder: share/man/man1 of an installation")
      ->required()
      ->type_name("DIR");
  command->footer("Installed with the program. To read one from the build: man -l FILE");
  command->callback([&app, &action, folder, command] {
    action = [&app, name = *folder, command] {
      return run(program_of(app), name, outputs_of(*command));
    };
  });
  describe(*command,
           {.examples = {{"Write the pages into the folder man1", "stickslip manual man1"}},
            .environment = {{"SOURCE_DATE_EPOCH", "Date of the pages, for reproducible builds"}},
            .see_also = {"man(1)", "stickslip-completion(1)"}});
}

}  // namespace stickslip::commands
