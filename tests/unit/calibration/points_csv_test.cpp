// SPDX-License-Identifier: Apache-2.0
#include "tools/calibration/points_csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "physics/problem.h"

namespace stickslip::calibration {
namespace {

using config::CalibrationPoint;

TEST(PointsCsv, AcceptsColumnsInAnyOrder) {
  EXPECT_THAT(parse_points("# by hand\nreference_si, raw\n0.0,1.5e-3\r\n\n2.5,-7\n", "p.csv"),
              testing::ElementsAre(CalibrationPoint{1.5e-3, 0.0, 0.0, 0.0},
                                   CalibrationPoint{-7.0, 0.0, 2.5, 0.0}));
  EXPECT_THAT(parse_points("raw,raw_std,reference_si,reference_sigma\n1,2,3,4", "p.csv"),
              testing::ElementsAre(CalibrationPoint{1.0, 2.0, 3.0, 4.0}));
}

TEST(PointsCsv, ErrorsNameTheLine) {
  const auto one = [](const char* text, const char* message) {
    try {
      parse_points(text, "p.csv");
      ADD_FAILURE() << "accepted: " << text;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::StartsWith(message));
    }
  };
  one("", "p.csv: holds no header");
  one("raw,reference_si\n", "p.csv: holds no points");
  one("#\nraw,force\n", "p.csv:2: unknown column \"force\"");
  one("raw,raw,reference_si\n", "p.csv:1: the column raw appears twice");
  one("raw,raw_std\n1,2\n", "p.csv:1: lacks the column reference_si");
  one("raw,reference_si\n1,2\n1\n", "p.csv:3: has 1 cell, expected 2");
  one("raw,reference_si\n1,2kg\n", "p.csv:2: reference_si: expected a number, found \"2kg\"");
  one("raw,reference_si\n1,nan\n", "p.csv:2: reference_si: expected a number, found \"nan\"");
  one("raw,reference_si,raw_std\n1,2,-3\n", "p.csv:2: raw_std: a standard deviation is 0 or more");
}

}  // namespace
}  // namespace stickslip::calibration
