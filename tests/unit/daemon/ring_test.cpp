// SPDX-License-Identifier: Apache-2.0
#include "daemon/ring.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <thread>

namespace stickslip::daemon {
namespace {

TEST(Ring, HasExactlyItsCapacity) {
  Ring<int> ring(3);
  EXPECT_EQ(ring.front(), nullptr);
  for (int i = 0; i < 3; ++i) {
    EXPECT_FALSE(ring.full());
    EXPECT_TRUE(ring.push(i));
  }
  EXPECT_TRUE(ring.full());
  EXPECT_FALSE(ring.push(3));
  EXPECT_EQ(ring.size(), 3U);
  ASSERT_NE(ring.front(), nullptr);
  EXPECT_EQ(*ring.front(), 0);
  ring.pop();
  EXPECT_TRUE(ring.push(4));
  EXPECT_EQ(*ring.front(), 1);
}

TEST(Ring, PassesEverythingInOrderBetweenTwoThreads) {
  constexpr std::uint64_t count = 200'000;
  Ring<std::uint64_t> ring(64);
  std::thread writer([&] {
    for (std::uint64_t i = 0; i < count;) {
      if (ring.push(i)) {
        ++i;
      } else {
        std::this_thread::yield();
      }
    }
  });
  bool in_order = true;
  for (std::uint64_t expected = 0; expected < count;) {
    const std::uint64_t* const next = ring.front();
    if (next == nullptr) {
      std::this_thread::yield();
      continue;
    }
    in_order = in_order && *next == expected++;
    ring.pop();
  }
  writer.join();
  EXPECT_TRUE(in_order);
  EXPECT_EQ(ring.size(), 0U);
}

}  // namespace
}  // namespace stickslip::daemon
