// SPDX-License-Identifier: Apache-2.0
// read and write may not use the heap, nor make a system call of their own: heap calls are counted,
// and a system call ends a process in strict seccomp mode.
#include <gtest/gtest.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <limits>
#include <vector>

#include "config/fault_script.h"
#include "config/rig.h"
#include "drivers/faults/faulty_driver.h"
#include "drivers/replay/replay_driver.h"
#include "drivers/simulated/simulated_driver.h"
#include "tests/unit/heap_count/heap_count.h"

#ifndef STICKSLIP_HEAP_IS_COUNTED
TEST(Allocation, IsMeasuredInBuildsWithoutSanitizer) {
  GTEST_SKIP() << "the sanitizer replaces the heap";
}
#else
namespace stickslip::drivers {
namespace {

/// Number of heap calls in `cycles` cycles of read and write, with the faults that both may return.
std::size_t heap_calls_of(Driver& driver, int cycles) {
  EXPECT_TRUE(driver.open());
  EXPECT_TRUE(driver.start());
  heap_count::start();
  Frame frame;
  for (int i = 0; i < cycles; ++i) {
    driver.read(frame);
    const double drive = i % 97 == 0 ? std::numeric_limits<double>::quiet_NaN()
                                     : 0.012 * std::sin(0.02 * static_cast<double>(i));
    driver.write({drive, i % 1000 < 900});
  }
  driver.stop();
  driver.read(frame);
  return heap_count::stop();
}

TEST(Allocation, HeapCallsAreCounted) { EXPECT_EQ(heap_count::self_test(), 2U); }

TEST(Allocation, ASimulatedRigDoesNotUseTheHeapWhileItRuns) {
  const config::Rig rig = config::load_rig(STICKSLIP_SOURCE_DIR "/config/simulated.toml");
  SimulatedDriver driver(rig.simulated, 1.0 / rig.loop.rate_hz);
  EXPECT_EQ(heap_calls_of(driver, 20000), 0U);
}

TEST(Allocation, AReplayDoesNotUseTheHeapWhileItRuns) {
  std::vector<Frame> frames(1000);
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i].time_ns = static_cast<std::int64_t>(i);
  for (const double speed : {0.0, 1.0}) {
    ReplayDriver driver(frames, speed);
    EXPECT_EQ(heap_calls_of(driver, 1500), 0U);
  }
}

/// A clock without waiting.
class NoClock final : public HostClock {
 public:
  std::int64_t now_ns() override { return 0; }
  void sleep_until(std::int64_t /*due_ns*/) override {}
};

/// The simulated rig with every kind of fault.
FaultyDriver everything() {
  const config::Rig rig = config::load_rig(STICKSLIP_SOURCE_DIR "/config/simulated.toml");
  return {std::make_unique<SimulatedDriver>(rig.simulated, 1.0 / rig.loop.rate_hz),
          config::load_fault_script(STICKSLIP_SOURCE_DIR "/config/faults/everything.toml"),
          Pace{1.0 / rig.loop.rate_hz, 1.0}, std::make_shared<NoClock>()};
}

constexpr int cycles_of_everything = 29000;

TEST(Allocation, InjectedFaultsDoNotUseTheHeap) {
  FaultyDriver driver = everything();
  ASSERT_TRUE(driver.open());
  ASSERT_TRUE(driver.start());
  std::size_t heap_calls = 0;
  Frame frame;
  for (int i = 0; i < cycles_of_everything; ++i) {
    heap_count::start();
    const Result result = driver.read(frame);
    driver.write({0.005, i % 1000 < 900});
    heap_calls += heap_count::stop();
    // Opening may allocate.
    if (result.outcome == Outcome::lost && driver.open()) {
      ASSERT_TRUE(driver.start());
    }
  }
  EXPECT_EQ(heap_calls, 0U);
  for (const Applied& applied : driver.applied()) EXPECT_GT(applied.hits, 0U);
}

/// Exit status of a process in strict seccomp mode that does this work.
template <class Work>
int status_without_system_calls(const Work& work) {
  const pid_t child = fork();
  if (child == 0) {
    if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) _exit(77);
    work();
    syscall(SYS_exit, 0);
  }
  int status = -1;
  waitpid(child, &status, 0);
  return status;
}

TEST(SystemCalls, NoneByInjectedFaults) {
  const int control = status_without_system_calls([] { getppid(); });
  if (WIFEXITED(control) && WEXITSTATUS(control) == 77) {
    GTEST_SKIP() << "this kernel does not support strict seccomp mode";
  }
  ASSERT_TRUE(WIFSIGNALED(control)) << "a system call must be detected";
  FaultyDriver driver = everything();
  ASSERT_TRUE(driver.open());
  ASSERT_TRUE(driver.start());
  const int status = status_without_system_calls([&driver] {
    Frame frame;
    for (int i = 0; i < cycles_of_everything; ++i) {
      const Result result = driver.read(frame);
      driver.write({0.005, i % 1000 < 900});
      if (result.outcome == Outcome::lost && driver.open()) driver.start();
    }
  });
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
}

}  // namespace
}  // namespace stickslip::drivers
#endif
