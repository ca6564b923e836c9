#include "tools/command_line/result_units.h"

#include <gtest/gtest.h>

namespace stickslip::command_line {
namespace {

TEST(ResultUnits, AreThoseOfTheInternationalSystem) {
  const ResultUnits units{physics::Model{}};
  EXPECT_EQ(units.after_number("m/s"), " m/s");
  EXPECT_EQ(units.after_number("1"), "");
  EXPECT_EQ(units.axis("x", "mm"), "x [mm]");
  EXPECT_EQ(units.axis("friction.mu", "1"), "friction.mu");
  EXPECT_EQ(units.column("velocity_m_s", "m/s"), "velocity_m_s");
}

TEST(ResultUnits, AreAbsentInADimensionlessModel) {
  physics::Model model;
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

}  // namespace
}  // namespace stickslip::command_line
