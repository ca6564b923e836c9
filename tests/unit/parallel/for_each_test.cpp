// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/parallel/for_each.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace stickslip::parallel {
namespace {

TEST(ForEach, CallsEveryIndexOnce) {
  for (const int threads : {1, 2, 7}) {
    std::vector<std::atomic<int>> done(100);
    for_each(100, threads, [&](std::size_t i) { ++done[i]; });
    for (const auto& each : done) EXPECT_EQ(each, 1);
  }
}

TEST(ForEach, RethrowsAnException) {
  EXPECT_THROW(for_each(10, 2,
                        [](std::size_t i) {
                          if (i == 3) throw std::runtime_error("piece 3");
                        }),
               std::runtime_error);
}

TEST(ForEach, RethrowsTheExceptionOfTheLowestIndex) {
  for (int round = 0; round < 20; ++round) {
    try {
      for_each(8, 4, [](std::size_t i) {
        // Higher indices throw earlier.
        std::this_thread::sleep_for(std::chrono::microseconds(200 * (8 - i)));
        if (i % 2 == 1) throw std::runtime_error(std::to_string(i));
      });
      FAIL() << "nothing was thrown";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "1");
    }
  }
}

}  // namespace
}  // namespace stickslip::parallel
