// SPDX-License-Identifier: Apache-2.0
// Checks of option values and the colour option.
#include "tools/command_line/option_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/command_line/colour_option.h"

namespace stickslip::command_line {
namespace {

using testing::HasSubstr;

/// Error message of a check; empty if the value passes.
std::string error(const CLI::Validator& check, std::string text) { return check(text); }

TEST(FiniteNumber, RefusesTextAndNonFiniteNumbers) {
  for (const char* text : {"0", "-1.5", "1e300", "0x10"}) {
    EXPECT_EQ(error(finite_number(), text), "") << text;
  }
  for (const char* text : {"", "abc", "1x", "nan", "inf", "-inf", "1e999"}) {
    EXPECT_THAT(error(finite_number(), text), HasSubstr("expected a finite number")) << text;
  }
}

TEST(PositiveNumber, ExcludesZero) {
  EXPECT_EQ(error(positive_number(), "1e-300"), "");
  EXPECT_EQ(error(positive_number(), "0"), "expected a finite number above 0, found 0");
  EXPECT_NE(error(positive_number(), "-1"), "");
}

TEST(NotNegativeNumber, IncludesZero) {
  EXPECT_EQ(error(not_negative_number(), "0"), "");
  EXPECT_EQ(error(not_negative_number(), "-1"), "expected a finite number, 0 or more, found -1");
}

TEST(WholeNumber, IncludesItsLimits) {
  const CLI::Validator check = whole_number(1, 500);
  EXPECT_EQ(error(check, "1"), "");
  EXPECT_EQ(error(check, "500"), "");
  for (const char* text : {"0", "501", "1.5", "nan"}) {
    EXPECT_EQ(error(check, text),
              "expected a whole number from 1 to 500, found " + std::string(text));
  }
}

TEST(NumberOfThreads, Permits0ForAllCores) {
  EXPECT_EQ(error(number_of_threads(), "0"), "");
  EXPECT_NE(error(number_of_threads(), "1025"), "");
}

// Less is refused by the diagnosis, whose own errors are no messages for a user.
TEST(Probability, IsNeitherOneNorTooSmall) {
  EXPECT_EQ(error(probability(), "0.01"), "");
  EXPECT_EQ(error(probability(), "1e-12"), "expected a number from 1e-9 to below 1, found 1e-12");
  EXPECT_NE(error(probability(), "1"), "");
}

TEST(SeedNumber, IsExactAsADouble) {
  EXPECT_EQ(error(seed_number(), "9007199254740992"), "");
  EXPECT_NE(error(seed_number(), "-1"), "");
}

TEST(ColourOption, HasThreeValues) {
  terminal::Colours colours = terminal::Colours::automatic;
  CLI::App app;
  add_colour_option(app, colours);
  app.parse("--color always", false);
  EXPECT_EQ(colours, terminal::Colours::always);
  app.parse("--color=never", false);
  EXPECT_EQ(colours, terminal::Colours::never);
  app.parse("--color auto", false);
  EXPECT_EQ(colours, terminal::Colours::automatic);
  EXPECT_THROW(app.parse("--color red", false), CLI::ParseError);
}

}  // namespace
}  // namespace stickslip::command_line
