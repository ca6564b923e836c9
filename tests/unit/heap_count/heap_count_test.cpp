// SPDX-License-Identifier: Apache-2.0
#include "tests/unit/heap_count/heap_count.h"

#include <gtest/gtest.h>

#include <cstdlib>

#ifndef STICKSLIP_HEAP_IS_COUNTED
TEST(HeapCount, IsUnavailableWithASanitizer) { GTEST_SKIP() << "the sanitizer replaces the heap"; }
#else
namespace stickslip::heap_count {
namespace {

TEST(HeapCount, CountsAllocationsAndReleases) {
  EXPECT_EQ(self_test(), 2U);
  EXPECT_FALSE(is_running());
  start();
  EXPECT_TRUE(is_running());
  stop();
}

TEST(HeapCount, CountsCallsOfTheCLibrary) {
  start();
  void* volatile block = std::calloc(2, 8);
  block = std::realloc(block, 32);
  std::free(block);
  block = std::aligned_alloc(64, 64);
  std::free(block);
  EXPECT_EQ(stop(), 5U);
}

TEST(HeapCount, CountsOnlyBetweenStartAndStop) {
  start();
  EXPECT_EQ(stop(), 0U);
  int* volatile one = new int(1);
  delete one;
  EXPECT_EQ(stop(), 0U);
}

}  // namespace
}  // namespace stickslip::heap_count
#endif
