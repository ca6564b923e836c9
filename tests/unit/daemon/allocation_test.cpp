// SPDX-License-Identifier: Apache-2.0
// The real-time path may not use the heap, take a lock or make a system call. Heap calls and locks
// of this program are counted, and a system call ends a process in strict seccomp mode.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <linux/seccomp.h>
#include <pthread.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "config/model_file.h"
#include "daemon/loop.h"
#include "tests/unit/daemon/fakes.h"
#include "tests/unit/heap_count/heap_count.h"

#ifdef STICKSLIP_HEAP_IS_COUNTED
namespace {
thread_local std::size_t locks = 0;

/// The library function of that name, which this program replaces.
template <class Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}
using Locking = int(pthread_mutex_t*);
using Waiting = int(pthread_cond_t*, pthread_mutex_t*);
Locking* const real_lock = real<Locking>("pthread_mutex_lock");
Locking* const real_try_lock = real<Locking>("pthread_mutex_trylock");
Waiting* const real_wait = real<Waiting>("pthread_cond_wait");
}  // namespace

extern "C" {
int pthread_mutex_lock(pthread_mutex_t* mutex) noexcept {
  if (stickslip::heap_count::is_running()) ++locks;
  // Before main, while the library itself is being made ready, there is nothing to call yet.
  return real_lock != nullptr ? real_lock(mutex) : 0;
}
int pthread_mutex_trylock(pthread_mutex_t* mutex) noexcept {
  if (stickslip::heap_count::is_running()) ++locks;
  return real_try_lock(mutex);
}
int pthread_cond_wait(pthread_cond_t* condition, pthread_mutex_t* mutex) {
  if (stickslip::heap_count::is_running()) ++locks;
  return real_wait(condition, mutex);
}
}

namespace stickslip::daemon {
namespace {

using drivers::Outcome;
using drivers::Result;
using namespace std::chrono_literals;

TEST(Allocation, HeapCallsAreCounted) { EXPECT_EQ(heap_count::self_test(), 2U); }

TEST(Allocation, LocksAreCounted) {
  std::mutex mutex;
  locks = 0;
  heap_count::start();
  mutex.lock();
  mutex.unlock();
  heap_count::stop();
  EXPECT_EQ(locks, 1U);
}

/// A loop with everything going wrong that can without ending it: overruns, missing and repeated
/// frames, NaN, temporary failures, full rings and a full notice ring, commands; and at the end a
/// stop or a fault.
struct Ordeal {
  static constexpr std::uint64_t cycles = 1'000'000;

  /// `another`: of another model, in place of which and back the observer is changed; may be null.
  Ordeal(bool fault, Observer* observer, Observer* another = nullptr)
      : present(observer), other(another) {
    driver.keep_actuations = false;
    clock.cost_per_reading_ns = 100;
    driver.on_read = [this, fault](std::uint64_t call) {
      if (call % 997 == 0) clock.now += 3'500'000;
      if (call % 1009 == 0) driver.sequence += 2;
      if (call % 1013 == 0 && driver.sequence > 0) driver.sequence -= 1;
      if (call % 1019 == 0) loop->ask(command(call));
      if (other != nullptr && call % 10'007 == 10'006 && loop->ask(observed_by(other))) {
        std::swap(present, other);
      }
      if (fault && call == cycles - 1) return Result{Outcome::lost, "the cable was pulled out"};
      return call % 101 == 7 ? Result{Outcome::temporary, "time-out"} : Result{};
    };
    driver.on_frame = [](Frame& frame) {
      if (frame.sequence % 13 == 0) frame.value[1] = std::numeric_limits<double>::infinity();
    };
    sink.keep = false;
    config::Excitation shaking;
    shaking.enabled = true;
    shaking.amplitude = 0.01;
    shaking.envelope = {{0.0, 0.0}, {1.0, 0.01}, {2.0, 0.0}};
    LoopSettings settings;
    settings.frames = fault ? 2 * cycles : cycles - 20'000;
    settings.start_at_once = true;
    settings.end_on_fault = true;
    settings.recorder = &stuck;
    loop.emplace(driver, clock, settings, Excitation(shaking), observer, ledger,
                 std::vector<Stream*>{&running, &stuck});
  }

  /// Swaps the two observers, as a change of the model does.
  static Command observed_by(Observer* next) {
    Command out;
    out.kind = Command::Kind::observe;
    out.observer = next;
    return out;
  }

  static Command command(std::uint64_t call) {
    Command out;
    out.kind = static_cast<Command::Kind>(call % 8);
    if (out.kind == Command::Kind::stop || out.kind == Command::Kind::disarm) {
      out.kind = Command::Kind::average;
    }
    out.frames = 50;
    out.setting = {Tunable::amplitude, 0.005};
    return out;
  }

  Observer* present;
  Observer* other;
  test::FakeDriver driver;
  test::FakeClock clock;
  test::FakeSink sink;
  Ledger ledger;
  Stream running{sink, ledger.published(), {.ring_frames = 512, .poll = 100us}};
  Stream stuck{sink, ledger.recorded(), {.ring_frames = 512}};
  std::optional<Loop> loop;
};

TEST(Allocation, AMillionCyclesUseNeitherHeapNorLocks) {
  for (const bool fault : {false, true}) {
    Ordeal ordeal(fault, nullptr);
    ordeal.running.start();

    locks = 0;
    heap_count::start();
    ordeal.loop->run();
    EXPECT_EQ(heap_count::stop(), 0U);
    EXPECT_EQ(locks, 0U);
    EXPECT_GT(ordeal.driver.reads, Ordeal::cycles - 30'000);
    EXPECT_EQ(ordeal.loop->end_status().reason,
              fault ? LoopEnd::Reason::fault : LoopEnd::Reason::frames_done)
        << ordeal.loop->end_status().message;
    EXPECT_GT(ordeal.loop->timing().overruns, 900U);
    EXPECT_GT(ordeal.loop->timing().repeated, 900U);
    EXPECT_GT(ordeal.ledger.balance().recorded.lost_to(Loss::ring_full), 900'000U);
    ordeal.running.finish(10s);
    ordeal.stuck.finish(0s);
    EXPECT_TRUE(ordeal.ledger.balance().is_closed());
  }
}

/// Exit status of a child process in strict seccomp mode that does this work.
template <class Work>
int status_without_system_calls(Work work) {
  const pid_t child = fork();
  if (child == 0) {
    if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) _exit(77);
    const bool done = work();
    syscall(SYS_exit, done ? 0 : 1);
  }
  int status = -1;
  waitpid(child, &status, 0);
  return status;
}

TEST(SystemCalls, AMillionCyclesWithAnObserverMakeNone) {
  const int control = status_without_system_calls([] { return getppid() > 0; });
  if (WIFEXITED(control) && WEXITSTATUS(control) == 77) {
    GTEST_SKIP() << "this kernel does not support strict seccomp mode";
  }
  ASSERT_TRUE(WIFSIGNALED(control)) << "a system call must be detected";
  physics::Model model = config::load_model(STICKSLIP_SOURCE_DIR "/config/models/simulated.toml");
  Observer observer(model, 1e-3);
  ASSERT_TRUE(observer.supported()) << observer.unsupported();
  model.terms.push_back({"cubic_stiffness", {}, {{"k3_n_m3", {7000.0}}}});
  Observer mended(model, 1e-3);
  Ordeal ordeal(true, &observer, &mended);
  const int status = status_without_system_calls([&ordeal, &mended] {
    ordeal.loop->run();
    return ordeal.driver.reads == Ordeal::cycles && mended.latest().sequence > 0;
  });
  ASSERT_TRUE(WIFEXITED(status)) << "ended by signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

// Every kind of drive, with its control and its limits, knobs turned, stops, starts and NaN.
TEST(Allocation, NoKindOfExcitationUsesTheHeap) {
  using enum config::ExcitationKind;
  const std::filesystem::path drive =
      std::filesystem::temp_directory_path() / ("stickslip-" + std::to_string(getpid()) + ".csv");
  std::ofstream(drive) << "time_s,base_displacement_m\n0,0\n1,0.004\n2,-0.004\n3,0\n";
  for (const config::ExcitationKind kind : {modulated, by_hand, sweep, chirp, multisine, file}) {
    config::Excitation settings;
    settings.enabled = true;
    settings.kind = kind;
    settings.amplitude = 0.01;
    settings.sweep = {.from_hz = 2.0, .to_hz = 5.0, .duration_s = 3.0};
    settings.multisine = {{}, 20, 1.0, 6.0};
    settings.file = {drive, config::DriveFileEnd::repeat};
    settings.control.enabled = true;
    Excitation excitation(settings, {{0.009, 0.2, 5.0}, Channel::base_displacement, 1e-3});
    excitation.start();
    heap_count::start();
    for (int i = 0; i < 100'000; ++i) {
      Frame frame;
      frame.set(Channel::base_displacement, i % 4001 == 0 ? std::numeric_limits<double>::quiet_NaN()
                                                          : 0.9 * excitation.now().value);
      excitation.observe(frame, true);
      excitation.advance(1e-3);
      if (i % 9973 == 0) excitation.set({Tunable::carrier_hz, 2.0 + i % 5});
      if (i % 7919 == 0) excitation.set({Tunable::amplitude, 0.001 * (i % 12)});
      if (i % 30'011 == 0) excitation.stop();
      if (i % 30'011 == 2000) excitation.start();
      if (i == 50'000) excitation.cut();
    }
    EXPECT_EQ(heap_count::stop(), 0U) << static_cast<int>(kind);
  }
  std::filesystem::remove(drive);
}

}  // namespace
}  // namespace stickslip::daemon
#else
TEST(Allocation, IsMeasuredInBuildsWithoutSanitizer) {
  GTEST_SKIP() << "the sanitizer replaces the heap";
}
#endif
