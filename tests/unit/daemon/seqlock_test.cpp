// SPDX-License-Identifier: Apache-2.0
#include "daemon/seqlock.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <thread>

namespace stickslip::daemon {
namespace {

// Every element holds the number of the write: a torn read is detected.
using Value = std::array<std::uint64_t, 50>;

TEST(SeqLock, AReaderOnlySeesConsistentValuesInOrder) {
  SeqLock<Value> latest;
  std::atomic<bool> done{false};
  std::thread writer([&] {
    Value value{};
    for (std::uint64_t i = 1; i <= 200'000; ++i) {
      value.fill(i);
      latest.write(value);
    }
    done = true;
  });
  std::uint64_t newest = 0;
  bool whole = true;
  while (!done) {
    const Value seen = latest.read();
    for (const std::uint64_t part : seen) whole = whole && part == seen[0];
    EXPECT_GE(seen[0], newest);
    newest = seen[0];
  }
  writer.join();
  EXPECT_TRUE(whole);
  EXPECT_EQ(latest.read()[49], 200'000U);
}

}  // namespace
}  // namespace stickslip::daemon
