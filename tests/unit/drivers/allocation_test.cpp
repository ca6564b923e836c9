// read and write may not touch the heap, nor make a system call of their own. Every allocation of
// this program passes through the counters below; system calls are fatal to a process that has
// forsworn them.
#include <gtest/gtest.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <vector>

#include "config/fault_script.h"
#include "config/rig.h"
#include "drivers/faults/faulty_driver.h"
#include "drivers/replay/replay_driver.h"
#include "drivers/simulated/simulated_driver.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
TEST(Allocation, IsMeasuredInBuildsWithoutSanitizer) {
  GTEST_SKIP() << "the sanitizer owns the heap";
}
#else
namespace {
thread_local bool counting = false;
thread_local std::size_t touches = 0;
}  // namespace

// glibc's own names for what is replaced here.
// NOLINTBEGIN(bugprone-reserved-identifier)
extern "C" {
void* __libc_malloc(std::size_t size);
void __libc_free(void* pointer);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* pointer, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  if (counting) ++touches;
  return __libc_malloc(size);
}
void free(void* pointer) {
  if (counting && pointer != nullptr) ++touches;
  __libc_free(pointer);
}
void* calloc(std::size_t count, std::size_t size) {
  if (counting) ++touches;
  return __libc_calloc(count, size);
}
void* realloc(void* pointer, std::size_t size) {
  if (counting) ++touches;
  return __libc_realloc(pointer, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  if (counting) ++touches;
  return __libc_memalign(alignment, size);
}
}
// NOLINTEND(bugprone-reserved-identifier)

namespace stickslip::drivers {
namespace {

/// Heap calls in `cycles` cycles of read and write, with the faults that both may return.
std::size_t touches_of(Driver& driver, int cycles) {
  EXPECT_TRUE(driver.open());
  EXPECT_TRUE(driver.start());
  touches = 0;
  counting = true;
  Frame frame;
  for (int i = 0; i < cycles; ++i) {
    driver.read(frame);
    const double drive = i % 97 == 0 ? std::numeric_limits<double>::quiet_NaN()
                                     : 0.012 * std::sin(0.02 * static_cast<double>(i));
    driver.write({drive, i % 1000 < 900});
  }
  driver.stop();
  driver.read(frame);
  counting = false;
  return touches;
}

TEST(Allocation, TheCounterSeesWhatItShould) {
  touches = 0;
  counting = true;
  int* volatile one = new int(1);  // volatile: a pair that nobody looks at is optimised away
  delete one;
  counting = false;
  EXPECT_EQ(touches, 2U);
}

TEST(Allocation, ASimulatedRigTouchesNoHeapWhileItRuns) {
  const config::Rig rig = config::load_rig(STICKSLIP_SOURCE_DIR "/config/simulated.toml");
  SimulatedDriver driver(rig.simulated, 1.0 / rig.loop.rate_hz);
  EXPECT_EQ(touches_of(driver, 20000), 0U);
}

TEST(Allocation, AReplayTouchesNoHeapWhileItRuns) {
  std::vector<Frame> frames(1000);
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i].time_ns = static_cast<std::int64_t>(i);
  for (const double speed : {0.0, 1.0}) {
    ReplayDriver driver(frames, speed);
    EXPECT_EQ(touches_of(driver, 1500), 0U);
  }
}

/// Hangs for no time.
class NoClock final : public HostClock {
 public:
  std::int64_t now_ns() override { return 0; }
  void sleep_until(std::int64_t /*due_ns*/) override {}
};

/// Everything that can befall the simulated rig.
FaultyDriver everything() {
  const config::Rig rig = config::load_rig(STICKSLIP_SOURCE_DIR "/config/simulated.toml");
  return {std::make_unique<SimulatedDriver>(rig.simulated, 1.0 / rig.loop.rate_hz),
          config::load_fault_script(STICKSLIP_SOURCE_DIR "/config/faults/everything.toml"),
          Pace{1.0 / rig.loop.rate_hz, 1.0}, std::make_shared<NoClock>()};
}

constexpr int cycles_of_everything = 29000;

TEST(Allocation, FaultsOnDemandTouchNoHeapWhileTheyLast) {
  FaultyDriver driver = everything();
  ASSERT_TRUE(driver.open());
  ASSERT_TRUE(driver.start());
  touches = 0;
  Frame frame;
  for (int i = 0; i < cycles_of_everything; ++i) {
    counting = true;
    const Result result = driver.read(frame);
    driver.write({0.005, i % 1000 < 900});
    counting = false;
    // Plugging in may take what it takes.
    if (result.outcome == Outcome::lost && driver.open()) {
      ASSERT_TRUE(driver.start());
    }
  }
  EXPECT_EQ(touches, 0U);
  for (const Applied& applied : driver.applied()) EXPECT_GT(applied.hits, 0U);
}

/// How a process ends that may only read, write and end, and does this.
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

TEST(SystemCalls, FaultsOnDemandMakeNone) {
  const int control = status_without_system_calls([] { getppid(); });
  if (WIFEXITED(control) && WEXITSTATUS(control) == 77) {
    GTEST_SKIP() << "this kernel does not let a process forswear system calls";
  }
  ASSERT_TRUE(WIFSIGNALED(control)) << "a system call has to be noticed";
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
