// SPDX-License-Identifier: Apache-2.0
// The observer runs in the real-time thread: an update may not use the heap.
#include <gtest/gtest.h>

#include "tests/unit/heap_count/heap_count.h"
#include "tests/unit/observer/bench.h"

#ifndef STICKSLIP_HEAP_IS_COUNTED
TEST(ObserverAllocation, IsMeasuredInBuildsWithoutSanitizer) {
  GTEST_SKIP() << "the sanitizer replaces the heap";
}
#else
namespace stickslip::observer {
namespace {

TEST(ObserverAllocation, HeapCallsAreCounted) { EXPECT_EQ(heap_count::self_test(), 2U); }

TEST(ObserverAllocation, UpdatesDoNotUseTheHeapThroughGapsOutliersAndRestarts) {
  physics::Model model = test::paper_rig(test::Law::state_variable, true);
  model.friction.rate_per_s.sigma = 30.0;
  model.normal_load->load_n.sigma = 0.01;
  model.oscillator.mass_kg.sigma = 0.001;
  model.oscillator.damping_ratio->sigma = 0.003;
  model.terms.push_back({"hysteresis", {}, {{"stiffness_n_m", {3.0}}, {"slip_force_n", {0.03}}}});
  model.terms.push_back({"channel_delay", Channel::friction_force, {{"delay_s", {0.006}}}});
  model.terms.push_back({"clipping", Channel::velocity, {{"limit", {0.15}}}});
  model.terms.push_back({"mains_hum",
                         Channel::velocity,
                         {{"frequency_hz", {50.0}}, {"amplitude", {0.01}}, {"phase_rad", {0.4}}}});
  physics::RigSimulator rig(model);
  const test::ModulatedBase base;
  std::vector<Frame> frames;
  for (int k = 1; k <= 4000; ++k) {
    rig.advance(1.0e-3, base(1.0e-3 * k));
    Frame frame = rig.read();
    if (k % 97 < 3) continue;
    if (k > 2000 && k < 2150) frame.set(Channel::displacement, 50.0);
    if (k % 31 == 0) frame.invalidate(Channel::velocity);
    frames.push_back(frame);
  }
  FrictionObserver observer(model, 1.0e-3);
  ASSERT_TRUE(observer.supported()) << observer.unsupported();
  heap_count::start();
  for (const Frame& frame : frames) observer.update(frame);
  EXPECT_EQ(heap_count::stop(), 0U);
  EXPECT_GT(observer.latest().restarts, 0U);

  // Nor does one with another model that goes on from it.
  model.terms.erase(model.terms.begin());
  FrictionObserver next(model, 1.0e-3);
  heap_count::start();
  const Continuation continuation = next.continue_from(observer);
  next.update(frames.back());
  EXPECT_EQ(heap_count::stop(), 0U);
  EXPECT_GT(continuation.kept, 10);
}

}  // namespace
}  // namespace stickslip::observer
#endif
