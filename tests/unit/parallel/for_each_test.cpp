#include "tools/parallel/for_each.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace stickslip::parallel {
namespace {

TEST(ForEach, DoesEveryPieceOnce) {
  for (const int threads : {1, 2, 7}) {
    std::vector<std::atomic<int>> done(100);
    for_each(100, threads, [&](std::size_t i) { ++done[i]; });
    for (const auto& each : done) EXPECT_EQ(each, 1);
  }
}

TEST(ForEach, PassesAnExceptionOn) {
  EXPECT_THROW(for_each(10, 2,
                        [](std::size_t i) {
                          if (i == 3) throw std::runtime_error("piece 3");
                        }),
               std::runtime_error);
}

}  // namespace
}  // namespace stickslip::parallel
