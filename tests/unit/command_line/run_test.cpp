// SPDX-License-Identifier: Apache-2.0
// From the command line to the exit status, with misspelt names.
#include "tools/command_line/run.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <stdexcept>

#include "physics/failure.h"
#include "physics/problem.h"

namespace stickslip::command_line {
namespace {

using ::testing::HasSubstr;

/// tool diagnose RECORDING --model M; tool log {check,info}; tool ctl --json {status,stop --wait}
struct Tool {
  Program program{"Tools.", "tool"};
  Action action = [] { return 0; };
  std::string recording, model;
  bool json = false, wait = false;

  Tool() {
    program.require_subcommand(1);
    CLI::App* const diagnose = program.add_subcommand("diagnose", "");
    diagnose->add_option("recording", recording, "")->required();
    diagnose->add_option("--model", model, "");
    CLI::App* const log = program.add_subcommand("log", "")->require_subcommand(1);
    log->add_subcommand("check", "");
    log->add_subcommand("info", "");
    CLI::App* const ctl = program.add_subcommand("ctl", "")->require_subcommand(1);
    ctl->add_flag("--json", json, "");
    ctl->add_subcommand("status", "")->fallthrough();
    ctl->add_subcommand("stop", "")->fallthrough()->add_flag("--wait", wait, "");
  }

  std::string wrong(const std::vector<std::string>& arguments) const {
    return wrong_name(program, arguments);
  }

  /// Status, and standard error.
  std::pair<int, std::string> ends(std::function<int()> what) {
    action = std::move(what);
    testing::internal::CaptureStderr();
    const int status = run(program, action, {"log", "check"});
    return {status, testing::internal::GetCapturedStderr()};
  }
};

TEST(WrongName, IsAnsweredWithTheOneThatWasMeant) {
  const Tool tool;
  EXPECT_EQ(tool.wrong({"diagnos"}),
            "there is no command \"diagnos\": did you mean `tool diagnose`?");
  EXPECT_EQ(tool.wrong({"log", "chekc", "run.log"}),
            "there is no command \"log chekc\": did you mean `tool log check`?");
  EXPECT_EQ(tool.wrong({"diagnose", "run.log", "--modle", "m.toml"}),
            "there is no option --modle: did you mean --model? (see `tool diagnose --help`)");
  EXPECT_THAT(tool.wrong({"diagnose", "--modle=m.toml"}), HasSubstr("did you mean --model?"));
  EXPECT_THAT(tool.wrong({"ctl", "status", "--jsno"}), HasSubstr("did you mean --json?"));
}

TEST(WrongName, WithoutANeighbourGetsTheList) {
  const Tool tool;
  EXPECT_EQ(tool.wrong({"ctl", "frobnicate"}),
            "there is no command \"ctl frobnicate\"; expected one of status, stop");
  EXPECT_EQ(tool.wrong({"log"}),
            "no command is given after \"tool log\"; expected one of check, info");
  EXPECT_EQ(tool.wrong({}), "no command is given; expected one of diagnose, log, ctl");
}

TEST(WrongName, IsNotSeenInValues) {
  const Tool tool;
  EXPECT_EQ(tool.wrong({"diagnose", "diagnos", "--model", "--modle"}), "");
  EXPECT_EQ(tool.wrong({"diagnose", "--model=chekc", "-x"}), "");
  EXPECT_EQ(tool.wrong({"ctl", "--json", "stop", "--wait"}), "");
  EXPECT_EQ(tool.wrong({"ctl", "stop", "--wait", "--json"}), "");
  EXPECT_EQ(tool.wrong({"diagnose", "--", "--modle"}), "");
  EXPECT_EQ(tool.wrong({"lgo", "--help"}), "") << "help is given for what is known";
}

TEST(Run, ReturnsTheStatusOfTheAction) {
  EXPECT_EQ(Tool().ends([] { return 1; }), std::pair(1, std::string()));
}

TEST(Run, PrintsEveryErrorAsOneLineWithoutTheTextOfForeignExceptions) {
  EXPECT_EQ(Tool().ends([]() -> int {
    throw InputError(Problem{"a.csv", 2, 0, "is empty"});
  }),
            std::pair(2, std::string("tool: a.csv:2: is empty\n")));
  EXPECT_EQ(Tool().ends([]() -> int { throw Failure("the daemon disconnected"); }),
            std::pair(1, std::string("tool: the daemon disconnected\n")));
  const auto [status, text] = Tool().ends([]() -> int { throw std::logic_error("map::at"); });
  EXPECT_EQ(status, 1);
  EXPECT_THAT(text, HasSubstr("Please report it"));
  EXPECT_EQ(text.find("map::at"), text.npos);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1);
  const auto missing = Tool().ends([]() -> int {
    static_cast<void>(std::filesystem::file_size("/nowhere/run.log"));
    return 0;
  });
  EXPECT_EQ(missing, std::pair(1, std::string("tool: /nowhere/run.log: cannot be used: No such "
                                              "file or directory\n")));
}

TEST(Run, RefusesWhatTheParserRefusesWithTheNameOfTheCommand) {
  Tool tool;
  testing::internal::CaptureStderr();
  EXPECT_EQ(run(tool.program, tool.action, {"diagnose", "a.log", "b.log"}), 2);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "tool: expected no further argument, found b.log (see `tool diagnose --help`)\n");
}

}  // namespace
}  // namespace stickslip::command_line
