#include "physics/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace stickslip::physics {
namespace {

TEST(ForEachParallel, DoesEveryPieceOnce) {
  for (const int threads : {1, 2, 7}) {
    std::vector<std::atomic<int>> done(100);
    for_each_parallel(100, threads, [&](std::size_t i) { ++done[i]; });
    for (const auto& each : done) EXPECT_EQ(each, 1);
  }
}

TEST(ForEachParallel, PassesAnExceptionOn) {
  EXPECT_THROW(for_each_parallel(10, 2,
                                 [](std::size_t i) {
                                   if (i == 3) throw std::runtime_error("piece 3");
                                 }),
               std::runtime_error);
}

}  // namespace
}  // namespace stickslip::physics
