#include "daemon/latest.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <thread>

namespace stickslip::daemon {
namespace {

// A value of which every part says which one it is: half of one and half of another would show.
using Value = std::array<std::uint64_t, 50>;

TEST(Latest, AReaderOnlySeesWholeValuesAndNeverAnOlderOne) {
  Latest<Value> latest;
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
