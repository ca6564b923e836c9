// The command line of `stickslip` as a whole.
#include "tools/commands/commands.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tools/command_line/run.h"
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
  std::set<std::string> names = {"ctl_calibrate"};
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
      {"--out", "what is written"},
      {"--force", "`calibration fit` accepts a poor fit too"},
      {"--model", "`scope` has a default"},
      {"--seed", "`conceal` has a random one"},
      {"--duration", "of what `conceal` and `doctor` make"},
      {"--truth", "`conceal` writes, `examine` reads"},
      {"--only", "figures, or cases"},
      {"--periods", "what is computed over them"},
      {"--values", "a flag of `spy`, a count of `bifurcation`"},
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
    std::swap(arguments.back()[1], arguments.back()[2]);
    EXPECT_THAT(command_line::wrong_name(parser.program, arguments),
                testing::HasSubstr(command.get_name() + "`?"));
  });
}

TEST(Commands, AreRefusedIfUnknown) {
  Parser parser;
  EXPECT_THROW(parser.program.parse("stickslip simulate --nonsense", true), CLI::ParseError);
}

}  // namespace
}  // namespace stickslip::commands
