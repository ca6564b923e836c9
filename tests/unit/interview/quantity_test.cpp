// SPDX-License-Identifier: Apache-2.0
#include "tools/interview/quantity.h"

#include <gtest/gtest.h>

#include <array>

namespace stickslip::interview {
namespace {

constexpr std::array units = {Unit{"kg", 0, 1.0, 1.0}, Unit{"g", 0, 1e-3, 1.0},
                              Unit{"N/m", 1, 1.0, 5.0}};

void expect(std::string_view text, physics::Parameter parameter, int kind) {
  const Quantity found = quantity_in(text, units);
  EXPECT_EQ(found.problem, "") << text;
  EXPECT_EQ(found.parameter.value, parameter.value) << text;
  EXPECT_EQ(found.parameter.sigma, parameter.sigma) << text;
  EXPECT_EQ(found.kind, kind) << text;
}

TEST(Quantity, HasAUnitAndAStandardDeviation) {
  expect("60 g +- 0.6 g", {0.06, 0.0006}, 0);
  expect("60g+-1%", {0.06, 0.0006}, 0);
  expect(" 60 +- 0.6 g ", {0.06, 0.0006}, 0);
  expect("60 g +/- 0.0006 kg", {0.06, 0.0006}, 0);
  expect("95.1 kg \u00b1 0.5", {95.1, 0.5}, 0);
  expect("1e3 N/m +- 2 %", {1000.0, 20.0}, 1);
}

TEST(Quantity, HasTheUsualStandardDeviationUnlessItIsStated) {
  expect("60 g", {0.06, 0.0006}, 0);
  expect("200 N/m", {200.0, 10.0}, 1);
  expect("60 g +- 0", {0.06, 0.0}, 0);
}

TEST(Quantity, IsRefusedWithTheExpectation) {
  for (const char* text : {"", "heavy", "nan kg", "inf kg", "60", "60 lb", "60 g +- N/m",
                           "60 g +- 1 N/m", "60 g +- -1", "60 g +-", "60 g 5", "+- 5 g"}) {
    const Quantity found = quantity_in(text, units);
    EXPECT_NE(found.problem.find(", found \""), std::string::npos) << text << ": " << found.problem;
  }
  EXPECT_EQ(quantity_in("60 lb", units).problem, "a number in kg or g or N/m, found \"60 lb\"");
}

}  // namespace
}  // namespace stickslip::interview
