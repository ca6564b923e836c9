// `stickslip manual`: the manual pages of all commands, from the parser itself.
#include "tools/terminal/manual_page.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include "tools/commands/commands.h"
#include "tools/files/write_file.h"
#include "tools/terminal/manual_notes.h"

namespace stickslip::commands {

using namespace files;

using namespace files;

namespace {

// An example that the parser would refuse must not be printed.
void try_examples(CLI::App& app, const terminal::Notes& notes) {
  for (const terminal::Notes::Example& each : notes.examples) {
    if (!each.command.starts_with("stickslip ")) continue;
    try {
      app.clear();
      app.parse(each.command, true);
    } catch (const CLI::ParseError& error) {
      throw std::runtime_error("the manual's example `" + each.command +
                               "` cannot be run: " + error.what());
    }
  }
}

int run(CLI::App& app, const std::filesystem::path& folder) {
  make_folder(folder);
  const terminal::Heading heading{"stickslip", 1, STICKSLIP_VERSION, terminal::date_of_build()};
  const std::string exit_status = terminal::exit_status_of(app);
  const auto write = [&](const CLI::App& command, const terminal::Notes& notes) {
    write_file(folder / (terminal::name_of(command, heading) + ".1"),
               terminal::page(command, heading, notes, exit_status));
  };
  std::size_t count = 1;
  write(app, terminal::manual_notes(""));
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (command->get_group().empty()) continue;
    write(*command, terminal::manual_notes(command->get_name()));
    ++count;
  }
  try_examples(app, terminal::manual_notes(""));
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    try_examples(app, terminal::manual_notes(command->get_name()));
  }
  std::printf("%s: %zu pages\n", folder.c_str(), count);
  return 0;
}

}  // namespace

void add_manual(CLI::App& app, Action& action) {
  auto folder = std::make_shared<std::string>();
  CLI::App* command =
      app.add_subcommand("manual", "Write the manual pages of these commands into a folder");
  command->add_option("folder", *folder, "Where to: share/man/man1 of an installation")
      ->required()
      ->type_name("DIR");
  command->footer("Installed with the program. To read one from the build: man -l FILE");
  command->callback(
      [&app, &action, folder] { action = [&app, name = *folder] { return run(app, name); }; });
}

}  // namespace stickslip::commands
