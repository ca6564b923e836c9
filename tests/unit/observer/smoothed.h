// What the smoother makes of what an observer has watched.
#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "observer/smoother.h"
#include "tests/unit/observer/bench.h"

namespace stickslip::observer::test {

inline std::vector<Frame> frames_of(const std::vector<Moment>& moments) {
  std::vector<Frame> frames;
  frames.reserve(moments.size());
  for (const Moment& moment : moments) frames.push_back(moment.frame);
  return frames;
}

/// The same moments with the estimates of the smoother in place of those of the filter.
inline std::vector<Moment> smoothed(std::vector<Moment> moments, const physics::Model& model,
                                    const SmoothingWindow& window = {}) {
  std::size_t next = 0;
  smooth(
      model, 1.0e-3, frames_of(moments),
      [&](const FrictionEstimate& e) { moments[next++].estimate = e; }, window);
  EXPECT_EQ(next, moments.size());
  return moments;
}

}  // namespace stickslip::observer::test
