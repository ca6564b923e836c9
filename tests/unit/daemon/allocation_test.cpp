// The hot path may not touch the heap. Every allocation of this program passes through the counters
// below; a cycle that makes one fails the test.
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <thread>

#include "daemon/loop.h"
#include "tests/unit/daemon/fakes.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define STICKSLIP_HEAP_IS_TAKEN 1
#endif

#ifndef STICKSLIP_HEAP_IS_TAKEN
namespace {
thread_local bool counting = false;
thread_local std::size_t allocations = 0;
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
  if (counting) ++allocations;
  return __libc_malloc(size);
}
void free(void* pointer) {
  if (counting && pointer != nullptr) ++allocations;
  __libc_free(pointer);
}
void* calloc(std::size_t count, std::size_t size) {
  if (counting) ++allocations;
  return __libc_calloc(count, size);
}
void* realloc(void* pointer, std::size_t size) {
  if (counting) ++allocations;
  return __libc_realloc(pointer, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  if (counting) ++allocations;
  return __libc_memalign(alignment, size);
}
}
// NOLINTEND(bugprone-reserved-identifier)

namespace stickslip::daemon {
namespace {

using drivers::Outcome;
using drivers::Result;
using namespace std::chrono_literals;

TEST(Allocation, TheCounterSeesWhatItShould) {
  allocations = 0;
  counting = true;
  int* volatile one = new int(1);  // volatile: a pair that nobody looks at is optimised away
  delete one;
  counting = false;
  EXPECT_EQ(allocations, 2U);
}

// With everything going wrong that can without ending the loop: overruns, missing frames, NaN,
// temporary failures, full rings and a full notice ring; and at the end a stop or a fault.
TEST(Allocation, AMillionCyclesTouchNoHeap) {
  for (const bool fault : {false, true}) {
    constexpr std::uint64_t cycles = 1'000'000;
    test::FakeDriver driver;
    driver.keep_actuations = false;
    test::FakeClock clock;
    clock.cost_of_look_ns = 100;
    driver.on_read = [&](std::uint64_t call) {
      if (call % 997 == 0) clock.now += 3'500'000;
      if (call % 1009 == 0) driver.sequence += 2;
      if (fault && call == cycles - 1) return Result{Outcome::lost, "the cable was pulled out"};
      return call % 101 == 7 ? Result{Outcome::temporary, "time-out"} : Result{};
    };
    driver.on_frame = [](Frame& frame) {
      if (frame.sequence % 13 == 0) frame.value[1] = std::numeric_limits<double>::infinity();
    };
    test::FakeSink sink;
    sink.keep = false;
    Ledger ledger;
    Stream running(sink, ledger.published(), {.ring_frames = 512, .poll = 100us});
    Stream stuck(sink, ledger.recorded(), {.ring_frames = 512});
    config::Excitation shaking;
    shaking.enabled = true;
    shaking.amplitude = 0.01;
    shaking.envelope = {{0.0, 0.0}, {1.0, 0.01}, {2.0, 0.0}};
    Loop loop(driver, clock, {.frames = fault ? 2 * cycles : cycles - 20'000}, Excitation(shaking),
              nullptr, ledger, {&running, &stuck});
    running.start();

    allocations = 0;
    counting = true;
    loop.run();
    counting = false;

    EXPECT_EQ(allocations, 0U);
    EXPECT_GT(driver.reads, cycles - 30'000);
    EXPECT_EQ(loop.why_ended().reason,
              fault ? LoopEnd::Reason::fault : LoopEnd::Reason::frames_done);
    EXPECT_GT(loop.timing().overruns, 900U);
    EXPECT_GT(ledger.balance().recorded.lost_to(Loss::ring_full), 900'000U);
    running.finish(10s);
    stuck.finish(0s);
    EXPECT_TRUE(ledger.balance().is_closed());
  }
}

// Every kind of drive, with its control and its limits, knobs turned, stops, starts and NaN.
TEST(Allocation, NoKindOfExcitationTouchesTheHeap) {
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
    allocations = 0;
    counting = true;
    for (int i = 0; i < 100'000; ++i) {
      Frame frame;
      frame.set(Channel::base_displacement, i % 4001 == 0 ? std::numeric_limits<double>::quiet_NaN()
                                                          : 0.9 * excitation.now().value);
      excitation.observe(frame, true);
      excitation.advance(1e-3);
      if (i % 9973 == 0) excitation.set({Knob::carrier_hz, 2.0 + i % 5});
      if (i % 7919 == 0) excitation.set({Knob::amplitude, 0.001 * (i % 12)});
      if (i % 30'011 == 0) excitation.stop();
      if (i % 30'011 == 2000) excitation.start();
      if (i == 50'000) excitation.cut();
    }
    counting = false;
    EXPECT_EQ(allocations, 0U) << static_cast<int>(kind);
  }
  std::filesystem::remove(drive);
}

}  // namespace
}  // namespace stickslip::daemon
#else
TEST(Allocation, IsMeasuredInBuildsWithoutSanitizer) {
  GTEST_SKIP() << "the sanitizer owns the heap";
}
#endif
