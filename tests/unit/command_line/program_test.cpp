// SPDX-License-Identifier: Apache-2.0
// Notes for manual pages, attached to the parser.
#include "tools/command_line/program.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace stickslip::command_line {
namespace {

TEST(Program, KeepsTheNotesOfEveryCommand) {
  Program program{"Tools.", "tool"};
  CLI::App* const log = program.add_subcommand("log", "Recordings");
  CLI::App* const check = log->add_subcommand("check", "Check a recording");
  describe(program, {.description = "of the program"});
  describe(*log, {.see_also = {"tool-spy(1)"}});
  describe(*check, {.examples = {{"Check it", "tool log check"}}});
  EXPECT_EQ(program.notes(program).description, "of the program");
  EXPECT_EQ(program.notes(*log).see_also.at(0), "tool-spy(1)");
  EXPECT_EQ(program.notes(*check).examples.at(0).command, "tool log check");
}

TEST(Program, HasEmptyNotesForOtherCommands) {
  Program program{"Tools.", "tool"};
  const CLI::App* const log = program.add_subcommand("log", "Recordings");
  EXPECT_TRUE(program.notes(*log).examples.empty());
}

TEST(Program, IsFoundFromAnyDepth) {
  Program program{"Tools.", "tool"};
  CLI::App* const check = program.add_subcommand("log", "")->add_subcommand("check", "");
  EXPECT_EQ(&program_of(*check), &program);
  EXPECT_EQ(&program_of(program), &program);
  CLI::App other;
  EXPECT_THROW(program_of(other), std::logic_error);
}

}  // namespace
}  // namespace stickslip::command_line
