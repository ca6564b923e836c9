// SPDX-License-Identifier: Apache-2.0
#include "physics/failure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <new>
#include <system_error>
#include <vector>

#include "physics/problem.h"

namespace stickslip {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Failure, InputAndForeseenFailuresSpeakForThemselves) {
  const Ending input = ending_of(InputError(Problem{"a.toml", 3, 1, "mu is -1"}), "stickslip");
  EXPECT_EQ(input.status, 2);
  EXPECT_EQ(input.line, "a.toml:3:1: mu is -1");
  const Ending failure = ending_of(Failure("run.log: is incomplete"), "stickslip");
  EXPECT_EQ(failure.status, 1);
  EXPECT_EQ(failure.line, "run.log: is incomplete");
}

TEST(Failure, OfTheSystemHasTheReasonOfTheSystem) {
  EXPECT_THAT(ending_of(std::bad_alloc(), "stickslip").line, HasSubstr("memory"));
  const std::system_error error(EAGAIN, std::generic_category(), "pthread_create");
  const Ending ending = ending_of(error, "stickslip");
  EXPECT_THAT(ending.line, HasSubstr("Resource temporarily unavailable"));
  EXPECT_THAT(ending.line, Not(HasSubstr("pthread_create")));
}

TEST(Failure, ThatIsUnforeseenAsksForAReportInsteadOfTheTextForProgrammers) {
  try {
    static_cast<void>(std::vector<int>().at(3));
    FAIL();
  } catch (const std::exception& error) {
    const Ending ending = ending_of(error, "stickslip");
    EXPECT_EQ(ending.status, 1);
    EXPECT_FALSE(ending.foreseen);
    EXPECT_THAT(ending.line, HasSubstr("Please report it"));
    EXPECT_THAT(ending.line, HasSubstr("stickslip --version"));
    EXPECT_THAT(ending.line, Not(HasSubstr("vector")));
  }
}

}  // namespace
}  // namespace stickslip
