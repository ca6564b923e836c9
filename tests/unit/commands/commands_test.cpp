// SPDX-License-Identifier: Apache-2.0
// The command line of `stickslip` as a whole.
#include "tools/commands/commands.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "physics/problem.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/run.h"
#include "tools/files/read_file.h"
#include "tools/files/temporary_folder.h"
#include "tools/files/write_file.h"
#include "tools/terminal/command_tree.h"

namespace stickslip::commands {
namespace {

namespace fs = std::filesystem;

struct Parser {
  command_line::Program program{"Tools.", "stickslip"};
  Action action;

  Parser() { add_subcommands(program, action); }

  /// Calls `check` with every command below the program, at any depth.
  void for_each(const std::function<void(const CLI::App&)>& check) const { visit(program, check); }

 private:
  static void visit(const CLI::App& app, const std::function<void(const CLI::App&)>& check) {
    for (const CLI::App* each : app.get_subcommands([](const CLI::App*) { return true; })) {
      check(*each);
      visit(*each, check);
    }
  }
};

TEST(Commands, EveryFileOfTheFolderIsACommand) {
  std::set<std::string> files;
  for (const auto& entry : fs::directory_iterator(STICKSLIP_SOURCE_DIR "/tools/commands")) {
    if (entry.path().extension() == ".cpp") files.insert(entry.path().stem());
  }
  std::set<std::string> names = {"ctl_calibrate", "ctl_model"};
  const Parser parser;
  for (const CLI::App* each : terminal::visible_subcommands(parser.program)) {
    EXPECT_TRUE(names.insert(each->get_name()).second) << each->get_name();
  }
  EXPECT_EQ(names, files);
}

TEST(Commands, HaveADescription) {
  Parser().for_each([](const CLI::App& command) {
    const std::string text = command.get_description();
    EXPECT_FALSE(text.empty()) << command.get_name();
    EXPECT_EQ(text.find('\n'), std::string::npos) << command.get_name();
    EXPECT_NE(text.back(), '.') << command.get_name() << ": the manual adds the full stop";
  });
}

TEST(Commands, DescribeEveryOption) {
  Parser().for_each([](const CLI::App& command) {
    for (const CLI::Option* option : command.get_options()) {
      EXPECT_FALSE(option->get_description().empty())
          << command.get_name() << " " << option->get_name();
    }
  });
}

TEST(Commands, HaveAnExampleAndReferencesInTheManual) {
  const Parser parser;
  for (const CLI::App* command : terminal::visible_subcommands(parser.program)) {
    const terminal::Notes notes = parser.program.notes(*command);
    EXPECT_FALSE(notes.see_also.empty()) << command->get_name();
    ASSERT_FALSE(notes.examples.empty()) << command->get_name();
    for (const auto& example : notes.examples) {
      EXPECT_TRUE(example.command.starts_with("stickslip " + command->get_name()))
          << example.command;
    }
  }
}

TEST(Commands, ParseTheirExamplesAndSetAnAction) {
  Parser parser;
  for (const CLI::App* command : terminal::visible_subcommands(parser.program)) {
    for (const auto& example : parser.program.notes(*command).examples) {
      parser.action = nullptr;
      parser.program.clear();
      EXPECT_NO_THROW(parser.program.parse(example.command, true)) << example.command;
      EXPECT_TRUE(parser.action) << example.command;
    }
  }
}

/// Type and description of an option; the checks of its value are left out.
std::string meaning_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::string kind = terminal::takes_value(option) ? type.substr(0, type.find(':')) : "flag";
  return kind + ": " + option.get_description();
}

TEST(Commands, SpellAndDescribeASharedOptionAlike) {
  // Names that mean different things, and why.
  const std::map<std::string, std::string> exceptions = {
      {"--json", "a file where a command computes, a flag where it shows something"},
      {"--write-model", "with the physics found, or the preferred law"},
      {"--campaign", "`diagnose` reads one, `conceal` makes them"},
      {"--svg", "a file where a command computes, a flag where it shows something"},
      {"--out", "what is written"},
      {"--force", "`calibration fit` accepts a poor fit too"},
      {"--model", "`scope` has a default"},
      {"--seed", "`conceal` has a random one"},
      {"--duration", "of what `conceal` and `doctor` make"},
      {"--truth", "`conceal` writes, `examine` reads"},
      {"--only", "figures, or cases"},
      {"--periods", "what is computed over them"},
      {"--values", "a flag of `spy`, a count of `bifurcation`"},
      {"--rig", "a flag of `conceal`, a file of `investigate`"},
      {"--yes", "to runs, or to questions"},
      {"--history", "of a page, or of calibrations"},
      {"RECORDING", "`diagnose` takes several"},
      {"FILE", "what is read"},
      {"OUT", "what is written"},
      {"DIR", "what is in it"},
  };
  std::map<std::string, std::map<std::string, std::string>> meanings;
  Parser().for_each([&](const CLI::App& command) {
    for (const CLI::Option* option : command.get_options()) {
      meanings[option->get_name()][meaning_of(*option)] = command.get_name();
    }
  });
  for (const auto& [name, found] : meanings) {
    if (exceptions.contains(name) || found.size() == 1) continue;
    for (const auto& [meaning, command] : found) {
      ADD_FAILURE() << name << " of " << command << " is \"" << meaning << '"';
    }
  }
}

TEST(Commands, NameFilesAndFoldersAsSuch) {
  const std::set<std::string> files = {"--model", "--out",     "--html",    "--config", "--file",
                                       "--truth", "--reports", "RECORDING", "OUT",      "DIR",
                                       "FILE",    "RIG",       "--socket",  "--presets"};
  Parser().for_each([&](const CLI::App& command) {
    for (const CLI::Option* option : command.get_options()) {
      if (!files.contains(option->get_name())) continue;
      const std::string type = option->get_type_name();
      EXPECT_TRUE(type == "FILE" || type == "DIR")
          << command.get_name() << " " << option->get_name() << " " << type;
    }
  });
}

TEST(Commands, AnswerAMisspeltNameAtAnyDepth) {
  const Parser parser;
  parser.for_each([&](const CLI::App& command) {
    std::vector<std::string> arguments;
    for (const CLI::App* at = &command; at != &parser.program; at = at->get_parent()) {
      arguments.insert(arguments.begin(), at->get_name());
    }
    std::string& word = arguments.back();
    const auto alike = std::adjacent_find(word.begin() + 1, word.end(), std::not_equal_to<>());
    std::iter_swap(alike, alike + 1);
    EXPECT_THAT(command_line::wrong_name(parser.program, arguments),
                testing::HasSubstr(command.get_name() + "`?"));
  });
}

TEST(Commands, AreRefusedIfUnknown) {
  Parser parser;
  EXPECT_THROW(parser.program.parse("stickslip simulate --nonsense", true), CLI::ParseError);
}

// Options with a text that is no file. A new option with a text is declared as a file
// (tools/command_line/file_options.h) or added here.
const std::set<std::string> texts = {
    "--url",    "--over",     "--reference",    "--by",        "--date",     "--raw-unit",
    "--effect", "--only",     "--explain",      "--socket",    "KEY",        "VALUE",
    "--listen", "--token",    "--allow-origin", "--host-name", "names",      "ID",
    "--unit",   "--snr",      "--model-name",   "--mass",      "--spring",   "--damping",
    "--load",   "--friction", "--sensors",      "--load-cell", "--hold-out", "--at",
    "TEXT"};

TEST(Commands, DeclareEveryOptionThatNamesAFile) {
  const Parser parser;
  parser.for_each([&](const CLI::App& command) {
    std::set<const CLI::Option*> declared;
    for (const auto& each : parser.program.file_options(command)) declared.insert(each.option);
    for (const CLI::Option* option : command.get_options()) {
      const std::string type = option->get_type_name();
      const bool number =
          type.starts_with("INT") || type.starts_with("UINT") || type.starts_with("FLOAT");
      const bool choice = type.find(":{") != std::string::npos;
      if (option->get_items_expected_max() == 0 || number || choice) continue;
      EXPECT_TRUE(declared.contains(option) || texts.contains(option->get_name()))
          << command.get_name() << ' ' << option->get_name() << ' ' << option->get_type_name();
    }
  });
}

// Every output of every command against each of its inputs and other outputs: nothing is written
// over what the command reads, and no two results into one file.
TEST(Commands, RefuseAnOutputThatIsAnInputOrAnotherOutput) {
  const files::TemporaryFolder folder;
  const std::string file = folder.path() / "one.csv";
  const std::string link = folder.path() / "link.csv";
  files::write_file(file, "input");
  fs::create_symlink("one.csv", link);
  std::size_t pairs = 0;
  Parser parser;
  parser.for_each([&](const CLI::App& command) {
    const auto options = parser.program.file_options(command);
    for (const auto& written : options) {
      if (written.role == command_line::FileRole::input) continue;
      for (const auto& other : options) {
        if (other.option == written.option) continue;
        parser.program.clear();
        const_cast<CLI::Option*>(written.option)->add_result(link);
        const_cast<CLI::Option*>(other.option)->add_result(file);
        EXPECT_THROW((void)command_line::outputs_of(command), InputError)
            << command.get_name() << ' ' << written.option->get_name() << ' '
            << other.option->get_name();
        ++pairs;
      }
    }
  });
  EXPECT_GT(pairs, 30U);
  EXPECT_EQ(files::content_of(file), "input");
}

TEST(Commands, RefuseAnOutputThatTheyDidNotWrite) {
  const files::TemporaryFolder folder;
  const std::string file = folder.path() / "foreign.csv";
  files::write_file(file, "by hand");
  std::size_t outputs = 0;
  Parser parser;
  parser.for_each([&](const CLI::App& command) {
    for (const auto& each : parser.program.file_options(command)) {
      if (each.role != command_line::FileRole::output) continue;
      parser.program.clear();
      const_cast<CLI::Option*>(each.option)->add_result(file);
      EXPECT_THROW((void)command_line::outputs_of(command), InputError)
          << command.get_name() << ' ' << each.option->get_name();
      CLI::Option* const force = const_cast<CLI::App&>(command).get_option_no_throw("--force");
      ASSERT_NE(force, nullptr) << command.get_name();
      force->add_result("true");
      EXPECT_NO_THROW((void)command_line::outputs_of(command)) << command.get_name();
      ++outputs;
    }
  });
  EXPECT_GT(outputs, 12U);
  EXPECT_EQ(files::content_of(file), "by hand");
}

}  // namespace
}  // namespace stickslip::commands
