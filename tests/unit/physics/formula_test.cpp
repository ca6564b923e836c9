// SPDX-License-Identifier: Apache-2.0
#include "physics/formula.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "physics/dual.h"
#include "physics/formula_units.h"

namespace stickslip::physics {
namespace {

const std::vector<std::string> symbols = {"x", "v", "c", "d"};
constexpr std::array<double, 4> somewhere = {0.3, -0.7, 1.9, 0.4};

double value(const std::string& text, const std::array<double, 4>& at = somewhere) {
  std::array<const double*, 4> pointers{};
  for (std::size_t i = 0; i < at.size(); ++i) pointers[i] = &at[i];
  return Formula(text, symbols).value(pointers.data());
}

Dual derivatives(const std::string& text) {
  std::array<Dual, 4> at;
  std::array<const Dual*, 4> pointers{};
  for (std::size_t i = 0; i < at.size(); ++i) {
    at[i] = Dual(somewhere[i]);
    at[i].d[static_cast<Eigen::Index>(i)] = 1.0F;
    pointers[i] = &at[i];
  }
  return Formula(text, symbols).value(pointers.data());
}

std::pair<std::size_t, std::string> error_of(const std::string& text) {
  try {
    const Formula formula(text, symbols);
  } catch (const FormulaError& error) {
    return {error.offset(), error.what()};
  }
  return {0, "accepted"};
}

TEST(Formula, HasTheUsualPrecedence) {
  EXPECT_EQ(value("1 + 2*3"), 7.0);
  EXPECT_EQ(value("(1 + 2)*3"), 9.0);
  EXPECT_EQ(value("2^3^2"), 512.0);
  EXPECT_EQ(value("-2^2"), -4.0);
  EXPECT_EQ(value("2^-1"), 0.5);
  EXPECT_EQ(value("8/4/2"), 1.0);
  EXPECT_EQ(value("5 - 3 - 1"), 1.0);
  EXPECT_EQ(value(" - ( x ) "), -somewhere[0]);
  EXPECT_EQ(value("+x"), somewhere[0]);
  EXPECT_EQ(value("1.5e-3*2E3 + .5 + 2."), 5.5);
  EXPECT_EQ(value("x\n  + v"), somewhere[0] + somewhere[1]);
}

TEST(Formula, IsEvaluatedAsTheSameExpressionInTheLanguage) {
  const auto [x, v, c, d] = somewhere;
  EXPECT_EQ(value("c*v*abs(v)"), c * v * std::abs(v));
  EXPECT_EQ(value("c*x^3"), c * (x * x * x));
  // The compiler evaluates functions of constants, to the last bit or nearly so.
  EXPECT_DOUBLE_EQ(value("c*v + d*v*abs(v)*exp(-(x/c)^2)"),
                   c * v + d * v * std::abs(v) * std::exp(-((x / c) * (x / c))));
  EXPECT_DOUBLE_EQ(
      value("log(c) + sqrt(d) + sin(x) + cos(v) + tan(x) + tanh(v)"),
      std::log(c) + std::sqrt(d) + std::sin(x) + std::cos(v) + std::tan(x) + std::tanh(v));
  EXPECT_EQ(value("min(x, v) + max(x, v) + sign(v) + sign(0)"), v + x - 1.0);
  EXPECT_DOUBLE_EQ(value("pow(c, d) + c^d + c^0.5 + 2^x"),
                   std::pow(c, d) + std::pow(c, d) + std::pow(c, 0.5) + std::pow(2.0, x));
  EXPECT_EQ(value("1/x - 2 + 3 - x + x/4"), 1.0 / x - 2.0 + 3.0 - x + x / 4.0);
  EXPECT_EQ(value("pi"), std::acos(-1.0));
  EXPECT_EQ(value("x"), x);
}

// Against differences of the plain value.
TEST(Formula, HasTheRightDerivatives) {
  constexpr double step = 1.0e-5;
  for (const std::string text :
       {"c*v*abs(v)", "x^3 + x^2*v", "c^d", "x^1.7", "2^x", "exp(-x*c)/d", "log(c*x)", "sqrt(c*d)",
        "sin(x)*cos(v)", "tan(x*d)", "tanh(v/d)", "min(x, v)*max(c, d)", "sign(v)*c", "1/(x + c)",
        "3 - x", "4/d", "-x/7", "x", "abs(v)^d"}) {
    const Dual found = derivatives(text);
    EXPECT_DOUBLE_EQ(found.a, value(text)) << text;
    for (std::size_t i = 0; i < somewhere.size(); ++i) {
      auto above = somewhere;
      auto below = somewhere;
      above[i] += step;
      below[i] -= step;
      const double slope = (value(text, above) - value(text, below)) / (2.0 * step);
      EXPECT_NEAR(found.d[static_cast<Eigen::Index>(i)], slope, 1.0e-5 * (1.0 + std::abs(slope)))
          << text << ", " << symbols[i];
    }
  }
}

TEST(Formula, HasFiniteDerivativesWhereASlopeIsInfinite) {
  std::array<Dual, 4> at{};
  at[0].d[0] = 1.0F;
  const std::array<const Dual*, 4> pointers = {&at[0], &at[1], &at[2], &at[3]};
  for (const std::string text : {"sqrt(abs(x))", "abs(x)^0.5", "x^1.5"}) {
    const Dual found = Formula(text, symbols).value(pointers.data());
    EXPECT_EQ(found.a, 0.0) << text;
    EXPECT_TRUE(found.d.isFinite().all()) << text;
  }
}

TEST(Formula, NamesTheColumnOfAnError) {
  using testing::HasSubstr;
  using testing::Pair;
  EXPECT_THAT(error_of("c*v + "), Pair(6, HasSubstr("expected a number, a symbol")));
  EXPECT_THAT(error_of(""), Pair(0, HasSubstr("expected a number, a symbol")));
  EXPECT_THAT(error_of("c*(v"), Pair(4, HasSubstr("expected an operator or )")));
  EXPECT_THAT(error_of("c*v)"), Pair(3, HasSubstr("expected an operator (+ - * / ^) or the end")));
  EXPECT_THAT(error_of("2 v"), Pair(2, HasSubstr("expected an operator")));
  EXPECT_THAT(error_of("c*vv"), Pair(2, HasSubstr("unknown symbol vv")));
  EXPECT_THAT(error_of("x + tnah(v)"), Pair(4, HasSubstr("did you mean tanh?")));
  EXPECT_THAT(error_of("x + abs(v, x)"), Pair(4, HasSubstr("abs takes 1 argument, found 2")));
  EXPECT_THAT(error_of("max(x)"), Pair(0, HasSubstr("max takes 2 arguments, found 1")));
  EXPECT_THAT(error_of("x + sin"), Pair(4, HasSubstr("sin is a function: expected sin(...)")));
  EXPECT_THAT(error_of("x ** 2"), Pair(3, HasSubstr("expected a number, a symbol")));
  EXPECT_THAT(error_of("1e999"), Pair(0, HasSubstr("out of range")));
  const std::string nested = std::string(70, '(').append("x").append(70, ')');
  EXPECT_THAT(error_of(nested), Pair(64, HasSubstr("parentheses within each other")));
  EXPECT_THAT(error_of(std::string("x").append(1000, ' ')),
              Pair(1000, HasSubstr("is longer than")));
  std::string many = "x";
  for (int i = 0; i < 97; ++i) many.append("+").append(std::to_string(i)).append("*v");
  EXPECT_THAT(error_of(many).second, HasSubstr("operations"));
}

TEST(Formula, KnowsWhichSymbolsItUses) {
  const Formula formula("c*v + 0*x - 0*x", symbols);
  EXPECT_TRUE(formula.uses(0) && formula.uses(1) && formula.uses(2));
  EXPECT_FALSE(formula.uses(3));
  EXPECT_TRUE(Formula("d", symbols).uses(3));
  EXPECT_FALSE(Formula("3", symbols).uses(0));
}

TEST(Formula, ComputesAPartThatOccursTwiceOnce) {
  EXPECT_EQ(Formula("abs(v)*x + abs(v)*c", symbols).operations().size(), 4U);
}

// ---- Units -------------------------------------------------------------------------------------

TEST(FormulaUnits, AreReadAndWritten) {
  for (const auto& [text, written] :
       std::vector<std::pair<std::string, std::string>>{{"N s/m", "N s/m"},
                                                        {"N s2/m2", "N s^2/m^2"},
                                                        {"N/m^3", "N/m^3"},
                                                        {"N/m\u00b3", "N/m^3"},
                                                        {"kg m/s^2", "N"},
                                                        {"kg", "kg"},
                                                        {"1/(m s)", "1/(m s)"},
                                                        {"1/s", "1/s"},
                                                        {"Hz", "1/s"},
                                                        {"m s\u207b\u00b2", "m/s^2"},
                                                        {"rad", "1"},
                                                        {"1", "1"}}) {
    const auto dimension = dimension_of(text);
    ASSERT_TRUE(dimension) << text;
    EXPECT_EQ(unit_text(*dimension), written) << text;
  }
  for (const std::string text : {"", "mm", "N/", "N^", "furlong", "(N", "N)", "2 N", "/m"}) {
    EXPECT_FALSE(dimension_of(text)) << text;
  }
}

std::string unit_or_error(const std::string& text) {
  const std::vector<std::optional<Dimension>> units = {dimension_of("m"), dimension_of("m/s"),
                                                       dimension_of("N s/m"), std::nullopt};
  try {
    const auto found = dimension_of(Formula(text, symbols), units);
    return found ? unit_text(*found) : "unknown";
  } catch (const FormulaError& error) {
    return std::to_string(error.offset()) + ": " + error.what();
  }
}

TEST(FormulaUnits, OfAFormulaFollowFromThoseOfItsSymbols) {
  EXPECT_EQ(unit_or_error("c*v"), "N");
  EXPECT_EQ(unit_or_error("2*c*v/3 - max(c*v, 0)"), "N");
  EXPECT_EQ(unit_or_error("x^2*sqrt(x*x)/(1/x)"), "m^4");
  EXPECT_EQ(unit_or_error("tanh(x/x)*sign(v)"), "1");
  EXPECT_EQ(unit_or_error("d*v"), "unknown");
  EXPECT_EQ(unit_or_error("d*v + c*v"), "N");
  EXPECT_EQ(unit_or_error("x + v"),
            "2: combines the units m and m/s: expected the same on both "
            "sides");
  EXPECT_EQ(unit_or_error("c*v + 1"),
            "4: combines the units N and 1: expected the same on both "
            "sides");
  EXPECT_EQ(unit_or_error("c*exp(x)"),
            "2: the argument of this function is a pure number, found the unit m");
  EXPECT_THAT(unit_or_error("2^x"), testing::HasSubstr("an exponent is a pure number"));
  EXPECT_THAT(unit_or_error("x^d"), testing::HasSubstr("the base of an exponent"));
}

}  // namespace
}  // namespace stickslip::physics
