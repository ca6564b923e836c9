// The observer runs in the real-time thread: an update may not touch the heap.
#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/unit/observer/bench.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
TEST(ObserverAllocation, IsMeasuredInBuildsWithoutSanitizer) {
  GTEST_SKIP() << "the sanitizer owns the heap";
}
#else
namespace {
bool counting = false;
std::size_t allocations = 0;
}  // namespace

// glibc's own names for what is replaced here. Eigen allocates by malloc, the library by new.
// NOLINTBEGIN(bugprone-reserved-identifier)
extern "C" {
void* __libc_malloc(std::size_t size);
void __libc_free(void* pointer);

void* malloc(std::size_t size) {
  if (counting) ++allocations;
  return __libc_malloc(size);
}
void free(void* pointer) {
  if (counting && pointer != nullptr) ++allocations;
  __libc_free(pointer);
}
}
// NOLINTEND(bugprone-reserved-identifier)

namespace stickslip::observer {
namespace {

TEST(ObserverAllocation, TheCounterSeesWhatItShould) {
  allocations = 0;
  counting = true;
  int* volatile one = new int(1);
  delete one;
  counting = false;
  EXPECT_EQ(allocations, 2U);
}

TEST(ObserverAllocation, UpdatesTouchNoHeapThroughGapsOutliersAndRestarts) {
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
  allocations = 0;
  counting = true;
  for (const Frame& frame : frames) observer.update(frame);
  counting = false;
  EXPECT_EQ(allocations, 0U);
  EXPECT_GT(observer.latest().restarts, 0U);
}

}  // namespace
}  // namespace stickslip::observer
#endif
