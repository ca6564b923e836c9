// SPDX-License-Identifier: Apache-2.0
#include "physics/result_units.h"

#include <gtest/gtest.h>

#include <regex>
#include <vector>

#include "physics/catalogue.h"

namespace stickslip::physics {
namespace {

TEST(ResultUnits, AreThoseOfTheInternationalSystem) {
  const ResultUnits units{Model{}};
  EXPECT_EQ(units.after_number("m/s"), " m/s");
  EXPECT_EQ(units.after_number("1"), "");
  EXPECT_EQ(units.axis("x", "mm"), "x [mm]");
  EXPECT_EQ(units.axis("friction.mu", "1"), "friction.mu");
  EXPECT_EQ(units.column("velocity_m_s", "m/s"), "velocity_m_s");
}

TEST(ResultUnits, AreAbsentInADimensionlessModel) {
  Model model;
  model.dimensionless = true;
  const ResultUnits units{model};
  EXPECT_EQ(units.after_number("m/s"), "");
  EXPECT_EQ(units.axis("x", "mm"), "x");
  EXPECT_EQ(units.column("velocity_m_s", "m/s"), "velocity");
  EXPECT_EQ(units.column("exponent_per_s", "1/s"), "exponent");
  EXPECT_EQ(units.column("drive.acceleration_m_s2", "m/s2"), "drive.acceleration");
  EXPECT_EQ(units.column("drive.frequency_hz", "Hz"), "drive.frequency");
  EXPECT_EQ(units.column("oscillator.stiffness_n_m", "N/m"), "oscillator.stiffness");
  EXPECT_EQ(units.column("friction.mu", "1"), "friction.mu");
}

TEST(ResultUnits, StandBehindNumbersInSentencesOrAreLeftOut) {
  const std::string text =
      "A stop after 2 mm, with 3e+04 N/m; from -0.5 to 1.5 m/s, k3 x^3 at 1 m.";
  EXPECT_EQ(ResultUnits(Model{}).sentence(text), text);
  Model model;
  model.dimensionless = true;
  const ResultUnits units{model};
  EXPECT_EQ(units.sentence(text), "A stop after 0.002, with 3e+04; from -0.5 to 1.5, k3 x^3 at 1.");
  EXPECT_EQ(units.sentence("late by 1.5 ms, 12 samples, 3 % per second, 7 x + 2 x^2 N s/m"),
            "late by 0.0015, 12 samples, 3 % per unit of time, 7 x + 2 x^2");
  EXPECT_EQ(units.of("m/s"), "1");
  EXPECT_EQ(units.column("slip_velocity_m_s"), "slip_velocity");
  EXPECT_EQ(units.column("theta"), "theta");
}

// Units that a sentence of the catalogue uses must be known.
TEST(ResultUnits, AreLeftOutOfEveryStatementOfTheCatalogue) {
  Model model;
  model.dimensionless = true;
  const std::regex unit(
      R"(\b(Hz|[mu]?m|[mu]?s|kg|[mu]?N|N/m\d?|m/s|millimetres?|seconds?|metres?)\b)");
  for (const Effect* effect : catalogue()) {
    std::vector<double> parameters;
    for (const ParameterCard& card : effect->card().parameters) {
      parameters.push_back(0.5 * (card.low + card.high));
    }
    const Place place = effect->card().relation == Relation::sensor
                            ? Place{Channel::friction_force, Channel::normal_load}
                            : Place{};
    const std::string text = ResultUnits(model).sentence(effect->statement(parameters, place));
    EXPECT_FALSE(std::regex_search(text, unit)) << effect->card().id << ": " << text;
  }
}

}  // namespace
}  // namespace stickslip::physics
