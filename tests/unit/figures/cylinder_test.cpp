// SPDX-License-Identifier: Apache-2.0
#include "tools/figures/cylinder.h"

#include <gtest/gtest.h>

#include <cmath>

namespace stickslip::figures {
namespace {

const Table& table(const Picture& picture, const std::string& name) {
  for (const Table& each : picture.tables) {
    if (each.name == name) return each;
  }
  throw std::out_of_range(name);
}

// A quarter of a period after the start, seen from above with the start on the right, a clockwise
// flow has arrived below: the paper's Figures 2 and 10.
TEST(CylindricalPortrait, FlowsClockwise) {
  const std::vector<PhasePoint> points = {{0.0, 0.0, 1.0}, {0.25, 1.0, 2.0}, {0.5, 1.0, -1.0}};
  const Picture picture = cylindrical_portrait(points, {"x", "v"}, "test");
  const auto& forth = table(picture, "forth").rows;
  ASSERT_GE(forth.size(), 2U);
  const double hole = 0.4;  // of the range of x, left free in the middle
  EXPECT_NEAR(forth[0][0], hole, 1.0e-12);
  EXPECT_NEAR(forth[0][1], 0.0, 1.0e-12);
  EXPECT_NEAR(forth[0][2], 1.0, 1.0e-12);
  EXPECT_NEAR(forth[1][0], 0.0, 1.0e-12);
  EXPECT_NEAR(forth[1][1], -(1.0 + hole), 1.0e-12);
  EXPECT_NEAR(forth[1][2], 2.0, 1.0e-12);
  // The line continues to the point beneath the plane and breaks there.
  ASSERT_GE(forth.size(), 4U);
  EXPECT_NEAR(forth[2][2], -1.0, 1.0e-12);
  EXPECT_TRUE(forth[3].empty());
  EXPECT_NEAR(table(picture, "back").rows.front()[2], -1.0, 1.0e-12);
}

TEST(CylindricalPortrait, RingsLieInThePlaneOfZeroVelocity) {
  const Picture picture =
      cylindrical_portrait({{0.0, -1.0, 1.0}, {0.5, 3.0, -1.0}}, {"x", "v"}, "test");
  for (const auto& row : table(picture, "rings").rows) {
    if (!row.empty()) {
      EXPECT_EQ(row[2], 0.0);
    }
  }
}

TEST(CylindricalPortrait, HasAxesWithNumbersAndUnits) {
  const Picture picture =
      cylindrical_portrait({{0.0, -5.0, -0.13}, {0.5, 8.8, 0.23}}, {"x [mm]", "v [m/s]"}, "test");
  for (const char* label : {"'x [mm]'", "'v [m/s]'", "'-5'", "'5'", "'0.2'", "'-0.1'", "'0.25'",
                            "'0.75'", "phase of the drive [turns]"}) {
    EXPECT_NE(picture.commands.find(label), std::string::npos) << label;
  }
  // The tick of x = 5 on the radius at phase 0.
  const double r = 5.0 + 5.0 + 0.4 * 13.8;
  bool found = false;
  for (const auto& row : table(picture, "axes").rows) {
    found = found || (row.size() == 3 && std::abs(row[0] - r) < 1.0e-9 && row[1] == 0.0);
  }
  EXPECT_TRUE(found);
}

TEST(NearRest, BreaksTheLineAtEachReversal) {
  const Picture picture =
      near_rest({{0.9, 0.0, 1.0}, {1.1, 0.0, 0.5}, {1.9, 0.0, -1.0}}, {"x", "v"}, 0.1, "test");
  const auto& rows = table(picture, "orbits").rows;
  ASSERT_EQ(rows.size(), 4U);
  EXPECT_TRUE(rows[1].empty());
  EXPECT_NEAR(rows[2][0], 0.1, 1.0e-12);
  EXPECT_NE(picture.commands.find("[-0.2:0.2]"), std::string::npos);
}

}  // namespace
}  // namespace stickslip::figures
