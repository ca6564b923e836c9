// SPDX-License-Identifier: Apache-2.0
// The smoother on the frames of an observer's run.
#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "observer/smoother.h"
#include "tests/unit/observer/bench.h"

namespace stickslip::observer::test {

inline std::vector<Frame> frames_of(const std::vector<Sample>& samples) {
  std::vector<Frame> frames;
  frames.reserve(samples.size());
  for (const Sample& sample : samples) frames.push_back(sample.frame);
  return frames;
}

/// The same samples with the estimates of the smoother instead of the filter's.
inline std::vector<Sample> smoothed(std::vector<Sample> samples, const physics::Model& model,
                                    const SmoothingWindow& window = {}) {
  std::size_t next = 0;
  smooth(
      model, 1.0e-3, frames_of(samples),
      [&](const FrictionEstimate& e) { samples[next++].estimate = e; }, window);
  EXPECT_EQ(next, samples.size());
  return samples;
}

}  // namespace stickslip::observer::test
