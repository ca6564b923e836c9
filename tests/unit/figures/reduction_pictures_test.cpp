// SPDX-License-Identifier: Apache-2.0
#include "tools/figures/reduction_pictures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

namespace stickslip::figures {
namespace {

TEST(MuMap, HasACellOfItsSizeForEachCellOfTheSurfaceAndALabelledScale) {
  reduction::Reduction reduced;
  for (const auto& [x, v, mu] :
       {std::array{-0.001, 0.1, 0.8}, std::array{0.001, 0.1, -0.5}, std::array{0.005, 0.2, 0.7}}) {
    reduction::Cell cell;
    cell.displacement_m = x;
    cell.velocity_m_s = v;
    cell.mu = mu;
    reduced.surface.push_back(cell);
  }
  const Picture picture = mu_map(reduced, "map");
  ASSERT_EQ(picture.tables.size(), 1U);
  ASSERT_EQ(picture.tables[0].rows.size(), 3U);
  const auto& row = picture.tables[0].rows[1];
  ASSERT_EQ(row.size(), 5U);
  EXPECT_DOUBLE_EQ(row[0], 1.0);
  EXPECT_DOUBLE_EQ(row[2], 1.0);  // half of the 2 mm between neighbours
  EXPECT_DOUBLE_EQ(row[3], 0.05);
  EXPECT_DOUBLE_EQ(row[4], -0.5);
  for (const char* part : {"'x [mm]'", "'v [m/s]'", "set cblabel 'mu", "[-0.8:0.8]"}) {
    EXPECT_THAT(picture.commands, testing::HasSubstr(part));
  }
}

TEST(MuMap, IsAmongThePicturesOfAReduction) {
  const auto pictures = reduction_pictures({});
  ASSERT_EQ(pictures.size(), 6U);
  EXPECT_EQ(pictures[1].stem, "map");
}

}  // namespace
}  // namespace stickslip::figures
