// SPDX-License-Identifier: Apache-2.0
// The simulated rig runs in the real-time thread in place of a device: no heap calls once built.
#include <gtest/gtest.h>

#include <cmath>

#include "physics/simulator.h"
#include "tests/unit/heap_count/heap_count.h"
#include "tests/unit/physics/rigs.h"

#ifndef STICKSLIP_HEAP_IS_COUNTED
TEST(SimulatorAllocation, IsMeasuredInBuildsWithoutSanitizer) {
  GTEST_SKIP() << "the sanitizer replaces the heap";
}
#else
namespace stickslip::physics {
namespace {

TEST(SimulatorAllocation, HeapCallsAreCounted) { EXPECT_EQ(heap_count::self_test(), 2U); }

TEST(SimulatorAllocation, AdvanceAndReadDoNotUseTheHeap) {
  Model model = test::bench();
  model.terms.push_back({"hysteresis", {}, {{"stiffness_n_m", {8.0}}, {"slip_force_n", {0.05}}}});
  for (Sensor& sensor : model.sensors) {
    sensor.noise_std = 1.0e-4;
    sensor.filters = {{FilterKind::butterworth_lowpass, 4, 25.0}};
  }
  RigSimulator rig(model);
  Input input;
  double sum = 0.0;
  heap_count::start();
  for (int k = 1; k <= 1000; ++k) {
    input.base_acceleration_m_s2 = k % 2 == 0 ? 4.0 : -4.0;
    // The period changes occasionally, and with it the filters' step.
    rig.advance(k % 100 == 0 ? 2.3e-3 : 1.0e-3, input);
    sum += rig.read()[Channel::displacement];
  }
  EXPECT_EQ(heap_count::stop(), 0U);
  EXPECT_TRUE(std::isfinite(sum));
}

}  // namespace
}  // namespace stickslip::physics
#endif
