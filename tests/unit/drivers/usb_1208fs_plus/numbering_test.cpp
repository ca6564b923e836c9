// SPDX-License-Identifier: Apache-2.0
#include "drivers/usb_1208fs_plus/numbering.h"

#include <gtest/gtest.h>

namespace stickslip::drivers::usb_1208fs_plus {
namespace {

constexpr std::int64_t ms = 1'000'000;

TEST(Usb1208fsPlusNumbering, CountsFromZero) {
  Numbering numbering(1e-3);
  numbering.begin(77 * ms);
  for (std::uint64_t i = 0; i < 5; ++i) EXPECT_EQ(numbering.take(), i);
}

TEST(Usb1208fsPlusNumbering, RestartedScanContinuesByTheClock) {
  Numbering numbering(1e-3);
  numbering.begin(1000 * ms);
  for (int i = 0; i < 40; ++i) numbering.take();
  numbering.arrived(1050 * ms);  // with any lateness
  numbering.begin(1300 * ms);
  EXPECT_EQ(numbering.take(), 300U);
}

TEST(Usb1208fsPlusNumbering, LeavesAGapOfAtLeastOne) {
  Numbering numbering(1e-3);
  numbering.begin(0);
  for (int i = 0; i < 100; ++i) numbering.take();
  numbering.begin(90 * ms);
  EXPECT_EQ(numbering.take(), 101U);
}

TEST(Usb1208fsPlusNumbering, RestartsAccumulateNoRounding) {
  Numbering numbering(1e-3);
  std::int64_t host_ns = 0;
  numbering.begin(host_ns);
  for (int start = 1; start <= 1000; ++start) {
    numbering.take();
    host_ns += 10 * ms + ms / 2;
    numbering.begin(host_ns);
  }
  EXPECT_NEAR(static_cast<double>(numbering.take()), 10500.0, 1.0);
}

/// An hour with a crystal that is 80 ppm slow: a drift of 288 scans, none lost.
TEST(Usb1208fsPlusNumbering, CrystalDriftIsNoLoss) {
  Numbering numbering(1e-3);
  numbering.begin(0);
  std::int64_t host_ns = 0;
  for (std::int64_t scan = 0; scan < 3'600'000; ++scan) {
    numbering.take();
    host_ns = (scan + 1) * ms + (scan + 1) * 80 + (scan % 7) * ms;
    numbering.arrived(host_ns);
  }
  numbering.begin(3'600'000 * ms + 3'600'000 * 80LL + 500 * ms);
  EXPECT_NEAR(static_cast<double>(numbering.take()), 3'600'500.0, 1.0);
}

}  // namespace
}  // namespace stickslip::drivers::usb_1208fs_plus
