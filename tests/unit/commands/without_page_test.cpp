// SPDX-License-Identifier: Apache-2.0
// `stickslip scope` of a program that was built without uPlot.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/command_line/run.h"
#include "tools/commands/commands.h"
#include "tools/scope/page.h"

namespace stickslip {

// In place of that of the library.
std::span<const scope::PageFile> scope::page_files() { return {}; }

namespace commands {
namespace {

TEST(WithoutPage, ScopeNamesTheRemedyAndServesNothing) {
  command_line::Program program{"Tools.", "stickslip"};
  Action action;
  add_subcommands(program, action);
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  const int status = command_line::run(program, action, {"scope", "--listen", "127.0.0.1:0"});
  EXPECT_EQ(status, 1);
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              testing::MatchesRegex("stickslip: .*without the page .*-DSTICKSLIP_SCOPE=ON.*\n"));
}

}  // namespace
}  // namespace commands
}  // namespace stickslip
