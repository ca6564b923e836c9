// SPDX-License-Identifier: Apache-2.0
#include "tools/figures/bifurcation_picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stickslip::figures {
namespace {

using testing::HasSubstr;
using testing::Not;

std::vector<dynamics::BifurcationColumn> two_values() {
  std::vector<dynamics::BifurcationColumn> columns(2);
  for (std::size_t i = 0; i < 2; ++i) {
    columns[i].value = 0.006 + 0.001 * static_cast<double>(i);
    columns[i].section.resize(3);
    columns[i].exponent_per_s = 0.5;
  }
  columns[1].section[2].state.s[physics::state::x] = 0.002;
  return columns;
}

const BifurcationAxes millimetres{"drive.amplitude [mm]", "displacement [mm]",
                                  "largest exponent [1/s]", 1.0e3, 1.0e3};

TEST(BifurcationPicture, ShowsEveryPointOverTheParameterInItsUnit) {
  const Picture picture = bifurcation_picture(two_values(), false, millimetres, "diagram");
  ASSERT_EQ(picture.tables.size(), 1U);
  ASSERT_EQ(picture.tables[0].rows.size(), 6U);
  EXPECT_DOUBLE_EQ(picture.tables[0].rows[5][0], 7.0);
  EXPECT_DOUBLE_EQ(picture.tables[0].rows[5][1], 2.0);
  EXPECT_THAT(picture.commands, HasSubstr("set xlabel 'drive.amplitude [mm]'"));
  EXPECT_THAT(picture.commands, HasSubstr("set ylabel 'displacement [mm]'"));
  EXPECT_THAT(picture.commands, HasSubstr("[6:7]"));
  EXPECT_THAT(picture.commands, Not(HasSubstr("multiplot")));
}

TEST(BifurcationPicture, HasAPanelOfExponents) {
  const Picture picture = bifurcation_picture(two_values(), true, millimetres, "diagram");
  ASSERT_EQ(picture.tables.size(), 2U);
  EXPECT_EQ(picture.tables[1].rows.size(), 2U);
  EXPECT_DOUBLE_EQ(picture.tables[1].rows[0][1], 0.5);
  EXPECT_THAT(picture.commands, HasSubstr("set ylabel 'largest exponent [1/s]'"));
}

}  // namespace
}  // namespace stickslip::figures
