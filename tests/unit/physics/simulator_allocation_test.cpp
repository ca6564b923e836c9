// The simulated rig runs in the real-time thread in place of a device: no heap after it is built.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "physics/simulator.h"
#include "tests/unit/physics/rigs.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
TEST(SimulatorAllocation, IsMeasuredInBuildsWithoutSanitizer) {
  GTEST_SKIP() << "the sanitizer owns the heap";
}
#else
namespace {
bool counting = false;
std::size_t allocations = 0;
}  // namespace

// glibc's own names for what is replaced here.
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

namespace stickslip::physics {
namespace {

TEST(SimulatorAllocation, TheCounterSeesWhatItShould) {
  allocations = 0;
  counting = true;
  int* volatile one = new int(1);
  delete one;
  counting = false;
  EXPECT_EQ(allocations, 2U);
}

TEST(SimulatorAllocation, AdvanceAndReadTouchNoHeap) {
  Model model = test::bench();
  model.terms.push_back({"hysteresis", {}, {{"stiffness_n_m", {8.0}}, {"slip_force_n", {0.05}}}});
  for (Sensor& sensor : model.sensors) {
    sensor.noise_std = 1.0e-4;
    sensor.filters = {{FilterKind::butterworth_lowpass, 4, 25.0}};
  }
  RigSimulator rig(model);
  Input input;
  double sum = 0.0;
  allocations = 0;
  counting = true;
  for (int k = 1; k <= 1000; ++k) {
    input.base_acceleration_m_s2 = k % 2 == 0 ? 4.0 : -4.0;
    // The period changes now and then, and with it the filters' step.
    rig.advance(k % 100 == 0 ? 2.3e-3 : 1.0e-3, input);
    sum += rig.read()[Channel::displacement];
  }
  counting = false;
  EXPECT_EQ(allocations, 0U);
  EXPECT_TRUE(std::isfinite(sum));
}

}  // namespace
}  // namespace stickslip::physics
#endif
