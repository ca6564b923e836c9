// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "daemon/event.h"
#include "tests/unit/daemon/fakes.h"

namespace stickslip::daemon {
namespace {

using drivers::Outcome;
using drivers::Result;
using testing::Contains;
using testing::Each;
using namespace std::chrono_literals;

constexpr std::int64_t ms = 1'000'000;

config::Excitation shaking() {
  config::Excitation out;
  out.enabled = true;
  out.amplitude = 0.01;
  out.ramp_s = 0.05;
  return out;
}

/// Starts without an operator, and ends with the first fault.
LoopSettings unattended(LoopSettings settings) {
  settings.start_at_once = true;
  settings.end_on_fault = true;
  return settings;
}

/// A loop on fakes, with one stream whose thread starts only when the samples are read.
struct Bench {
  explicit Bench(LoopSettings settings = {}, const config::Excitation& excitation = shaking(),
                 bool stepped_time = false)
      : driver(stepped_time),
        loop(driver, clock, unattended(settings), Excitation(excitation), nullptr, ledger,
             {&stream}) {}

  const std::vector<Sample>& samples() {
    stream.start();
    stream.finish(10s);
    return sink.samples;
  }
  std::vector<Notice> notices() {
    std::vector<Notice> out;
    Notice notice;
    while (loop.next_notice(notice)) out.push_back(notice);
    return out;
  }

  test::FakeDriver driver;
  test::FakeClock clock;
  test::FakeSink sink;
  Ledger ledger;
  Stream stream{sink, ledger.published(), {.poll = 100us}};
  Loop loop;
};

MATCHER_P(IsKind, kind, "") { return arg.kind == kind; }
MATCHER(IsOff, "") { return !arg.amplifier_on && arg.drive == 0.0; }

TEST(Loop, RunsTheRequestedFramesAndEndsWithTheAmplifierOff) {
  Bench bench({.frames = 1000, .ramp_s = 0.05});
  EXPECT_EQ(bench.loop.run().reason, LoopEnd::Reason::frames_done);
  EXPECT_EQ(bench.loop.snapshot().state, RigState::idle);
  EXPECT_TRUE(bench.driver.stopped);
  EXPECT_THAT(bench.driver.last, IsOff());
  ASSERT_EQ(bench.samples().size(), 1000U);
  for (std::uint64_t i = 0; i < 1000; ++i) {
    ASSERT_EQ(bench.sink.samples[i].frame.sequence, i);
  }
  EXPECT_TRUE(bench.ledger.balance().is_closed());
  // The ramp down is part of the duration: the last frames see no drive.
  EXPECT_EQ(bench.sink.samples.back().drive.value, 0.0);
  EXPECT_FALSE(bench.sink.samples.back().amplifier_on);
  EXPECT_TRUE(bench.sink.samples[500].amplifier_on);
}

TEST(Loop, ReportsALastOffThatWasNotAcknowledgedWithItsRemedy) {
  Bench bench({.frames = 20, .ramp_s = 0.01});
  bench.driver.left = "fake may still be on: press the emergency stop";
  bench.loop.run();
  const auto notices = bench.notices();
  ASSERT_THAT(notices, Contains(IsKind(Notice::Kind::left_on)));
  const Event event = event_of(notices.back());
  EXPECT_EQ(event.code, "left_on");
  EXPECT_EQ(event.severity, Severity::error);
  EXPECT_EQ(event.message, "fake may still be on: press the emergency stop");
}

TEST(Loop, KeepsTheGridOfItsDeadlines) {
  Bench bench({.frames = 500, .ramp_s = 0.05});
  const std::int64_t origin = bench.clock.now;
  bench.driver.on_read = [&](std::uint64_t) {
    EXPECT_EQ((bench.clock.now - origin) % ms, 0);
    return Result{};
  };
  bench.loop.run();
  EXPECT_EQ(bench.clock.now - origin, 499 * ms);
  EXPECT_EQ(bench.loop.timing().overruns, 0U);
  EXPECT_EQ(bench.loop.timing().lateness.longest_ns(), 0);
}

TEST(Loop, CountsAnOverrunWithItsDurationAndKeepsPhase) {
  Bench bench({.frames = 100, .ramp_s = 0.01});
  const std::int64_t origin = bench.clock.now;
  bench.driver.on_read = [&](std::uint64_t call) {
    if (call == 50) bench.clock.now += 5 * ms + 300'000;
    if (call == 52) {
      EXPECT_EQ((bench.clock.now - origin) % ms, 0);
    }
    return Result{};
  };
  bench.loop.run();
  const Timing& timing = bench.loop.timing();
  EXPECT_EQ(timing.overruns, 1U);
  EXPECT_EQ(timing.skipped_periods, 4U);
  EXPECT_EQ(timing.longest_overrun_ns, 4 * ms + 300'000);
  EXPECT_EQ(timing.lateness.longest_ns(), 300'000);
  const auto notices = bench.notices();
  const auto overrun = std::find_if(notices.begin(), notices.end(), [](const Notice& notice) {
    return notice.kind == Notice::Kind::overrun;
  });
  ASSERT_NE(overrun, notices.end());
  EXPECT_EQ(overrun->count, 4U);
  EXPECT_EQ(overrun->duration_ns, 4 * ms + 300'000);
  EXPECT_TRUE(bench.samples()[51].late);
  EXPECT_FALSE(bench.sink.samples[52].late);
}

TEST(Loop, ExcitationKeepsItsPhaseThroughAnOverrun) {
  config::Excitation steady = shaking();
  steady.ramp_s = 0.0;
  Bench bench({.frames = 400, .ramp_s = 0.0}, steady);
  const std::int64_t origin = bench.clock.now;
  bench.driver.on_read = [&](std::uint64_t call) {
    if (call == 100) bench.clock.now += 7 * ms + 1;
    return Result{};
  };
  std::vector<double> times_s;
  bench.driver.on_write = [&](std::uint64_t) {
    const std::int64_t cycle = (bench.clock.now - origin) / ms;
    times_s.push_back(static_cast<double>(cycle) * 1e-3);
    return Result{};
  };
  bench.loop.run();
  for (const std::size_t i : {50UL, 99UL, 101UL, 102UL, 300UL}) {
    // The cycle on the grid at t drives for the end of its period.
    const double expected = 0.01 * std::sin(2.0 * M_PI * 2.5 * (times_s[i] + 1e-3));
    EXPECT_NEAR(bench.driver.actuations[i].drive, expected, 1e-9) << i;
  }
}

// A simulated rig does not advance while the host is late: there was no pause in its time.
TEST(Loop, ARigWithSimulatedTimeIsDrivenThroughAnOverrunWithoutAGap) {
  config::Excitation steady = shaking();
  steady.ramp_s = 0.0;
  Bench bench({.frames = 400, .ramp_s = 0.0}, steady, true);
  bench.driver.on_read = [&](std::uint64_t call) {
    if (call == 100) bench.clock.now += 7 * ms + 1;
    return Result{};
  };
  bench.loop.run();
  EXPECT_EQ(bench.loop.timing().overruns, 1U);
  for (const std::size_t i : {50UL, 99UL, 100UL, 101UL, 102UL, 300UL}) {
    // The frame at i ms is answered with the drive for the end of its period.
    const double expected = 0.01 * std::sin(2.0 * M_PI * 2.5 * 1e-3 * static_cast<double>(i + 1));
    EXPECT_NEAR(bench.driver.actuations[i].drive, expected, 1e-9) << i;
  }
}

// Found in a soak test on a busy machine: a delay between the read and the check of interlocks.
TEST(Loop, ADelayAfterTheReadMakesNoChannelStale) {
  LoopSettings settings;
  settings.frames = 200;
  settings.ramp_s = 0.05;
  settings.live.interlocks.stale_after_ns = 50 * ms;
  Bench bench(settings);
  bench.clock.cost_per_reading_ns = 100;
  int looks = 0;
  bench.driver.on_frame = [&](Frame& frame) {
    if (frame.sequence == 120) looks = 1;
  };
  bench.clock.on_reading = [&] {
    // The first reading of the clock is that of the device's answer; the delay comes before the
    // next.
    if (looks > 0 && looks++ == 2) bench.clock.now += 80 * ms;
  };
  EXPECT_EQ(bench.loop.run().reason, LoopEnd::Reason::frames_done)
      << bench.loop.end_status().message;
  EXPECT_EQ(looks > 2, true);
}

TEST(Loop, AStopRequestRampsDownAndASecondOneEndsImmediately) {
  for (const int requests : {1, 2}) {
    Bench bench;
    bench.driver.on_read = [&](std::uint64_t call) {
      if (call == 200) {
        for (int i = 0; i < requests; ++i) bench.loop.request_stop();
      }
      return Result{};
    };
    EXPECT_EQ(bench.loop.run().reason, LoopEnd::Reason::requested);
    EXPECT_THAT(bench.driver.last, IsOff());
    const std::size_t after = bench.driver.reads - 201;
    if (requests == 1) {
      EXPECT_NEAR(static_cast<double>(after), 50.0, 2.0);
      double step = 0.0;
      for (std::size_t i = 1; i < bench.driver.actuations.size(); ++i) {
        step = std::max(step, std::abs(bench.driver.actuations[i].drive -
                                       bench.driver.actuations[i - 1].drive));
      }
      EXPECT_LT(step, 0.01 * (2.0 * M_PI * 2.5 + 1.5 / 0.05) * 1e-3);
    } else {
      EXPECT_LE(after, 2U);
    }
    EXPECT_EQ(bench.samples().size(), bench.driver.sequence);
    EXPECT_TRUE(bench.ledger.balance().is_closed());
  }
}

TEST(Loop, EveryDeviceFaultSwitchesTheAmplifierOffInTheSameCycle) {
  for (const Outcome outcome : {Outcome::lost, Outcome::fatal, Outcome::needs_attention}) {
    Bench bench;
    bench.driver.on_read = [&](std::uint64_t call) {
      return call == 120 ? Result{outcome, "cable pulled"} : Result{};
    };
    const LoopEnd& end = bench.loop.run();
    EXPECT_EQ(end.reason, LoopEnd::Reason::fault);
    EXPECT_EQ(end.outcome, outcome);
    EXPECT_EQ(end.message, "cable pulled");
    EXPECT_EQ(bench.driver.reads, 121U);
    ASSERT_GE(bench.driver.actuations.size(), 121U);
    EXPECT_TRUE(bench.driver.actuations[119].amplifier_on);
    for (std::size_t i = 120; i < bench.driver.actuations.size(); ++i) {
      EXPECT_THAT(bench.driver.actuations[i], IsOff());
    }
    EXPECT_THAT(bench.notices(), Contains(IsKind(Notice::Kind::fault)));
    EXPECT_EQ(bench.loop.snapshot().state, RigState::faulted);
    EXPECT_EQ(bench.samples().size(), 120U);
  }
}

TEST(Loop, AFaultOfAWriteIsFollowedByOffInTheSameCycle) {
  Bench bench;
  bench.driver.on_write = [&](std::uint64_t call) {
    return call == 100 ? Result{Outcome::lost, "DAC gone"} : Result{};
  };
  EXPECT_EQ(bench.loop.run().message, "DAC gone");
  EXPECT_EQ(bench.driver.reads, 101U);
  EXPECT_THAT(bench.driver.actuations[101], IsOff());
}

TEST(Loop, BufferedSamplesAfterAStallDoNotSpeedUpTheDrive) {
  LoopSettings settings = unattended({.pacing = Pacing::driver});
  settings.live.interlocks.longest_overrun_ns = 50 * ms;
  Bench bench(settings);
  bench.driver.on_read = [&](std::uint64_t call) {
    // Bundles of five samples, as a board delivers them; then the loop stalls.
    if (call % 5 == 0) bench.clock.now += 5 * ms;
    if (call == 400) bench.clock.now += 300 * ms;
    return Result{};
  };
  bench.loop.run();
  EXPECT_EQ(bench.loop.snapshot().interlock, Interlock::overrun);
  EXPECT_EQ(bench.loop.timing().overruns, 1U);
  EXPECT_THAT(bench.driver.last, IsOff());
  EXPECT_LE(bench.driver.reads, 402U);
}

TEST(Loop, APacedDriverMayWaitUpToItsLimit) {
  LoopSettings settings = unattended({.pacing = Pacing::driver, .frames = 50, .ramp_s = 0.0});
  settings.live.interlocks.longest_overrun_ns = 5 * ms;
  Bench bench(settings);
  bench.driver.on_read = [&](std::uint64_t) {
    bench.clock.now += drivers::longest_paced_wait_ns;
    return Result{};
  };
  EXPECT_EQ(bench.loop.run().reason, LoopEnd::Reason::frames_done);
  EXPECT_EQ(bench.loop.timing().overruns, 0U);
}

TEST(Loop, ALostDeviceIsReleasedEvenIfAMoreSeriousInterlockIsBroken) {
  test::FakeDriver driver;
  test::FakeClock clock;
  Ledger ledger;
  Loop loop(driver, clock, {}, Excitation(shaking()), nullptr, ledger, {});
  driver.lines.emergency_stop = true;
  ASSERT_TRUE(loop.begin());
  loop.wait();
  loop.cycle();
  EXPECT_FALSE(loop.device_lost());
  driver.on_write = [](std::uint64_t) { return Result{Outcome::lost, "the chip is disconnected"}; };
  loop.wait();
  loop.cycle();
  EXPECT_EQ(loop.snapshot().broken, Interlock::emergency_stop);
  EXPECT_TRUE(loop.device_lost());
}

TEST(Loop, TheCauseSurvivesADriverThatReusesItsMessage) {
  Bench bench;
  std::string message = "unplugged";
  bench.driver.on_read = [&](std::uint64_t call) {
    return call == 3 ? Result{Outcome::lost, message.c_str()} : Result{};
  };
  bench.driver.on_write = [&](std::uint64_t call) {
    if (call >= 3) message = "overwritten";
    return Result{};
  };
  EXPECT_EQ(bench.loop.run().message, "unplugged");
}

TEST(Loop, TemporaryFailuresAreCountedAndAreFaultsOnlyIfTheyPersist) {
  LoopSettings settings;
  settings.live.interlocks.longest_silence_ns = 20 * ms;
  Bench bench(settings);
  bench.driver.on_read = [&](std::uint64_t call) {
    const bool fails = (call >= 50 && call < 60) || call >= 100;
    return fails ? Result{Outcome::temporary, "time-out"} : Result{};
  };
  EXPECT_EQ(bench.loop.run().reason, LoopEnd::Reason::fault);
  EXPECT_EQ(bench.driver.reads, 121U);
  EXPECT_EQ(bench.loop.timing().failed_reads, 10U + 21U);
  const auto notices = bench.notices();
  EXPECT_EQ(std::count_if(notices.begin(), notices.end(),
                          [](const Notice& n) { return n.kind == Notice::Kind::read_failed; }),
            2);
}

TEST(Loop, ADriverThatDoesNotStartIsAFaultAndNothingIsRead) {
  Bench bench;
  bench.driver.start_result = {Outcome::needs_attention, "no permission on /dev/hidraw0"};
  EXPECT_EQ(bench.loop.run().message, "no permission on /dev/hidraw0");
  EXPECT_EQ(bench.driver.reads, 0U);
  EXPECT_THAT(bench.driver.actuations, Each(IsOff()));
}

TEST(Loop, EndsWithTheDataAndCountsTheFramesThatTheSourceLost) {
  Bench bench({.pacing = Pacing::free_running});
  bench.driver.on_read = [&](std::uint64_t call) {
    if (call == 10) bench.driver.sequence += 3;
    return call == 40 ? Result{Outcome::end_of_data, ""} : Result{};
  };
  EXPECT_EQ(bench.loop.run().reason, LoopEnd::Reason::end_of_data);
  EXPECT_EQ(bench.loop.timing().missing_at_source, 3U);
  EXPECT_THAT(bench.notices(), Contains(IsKind(Notice::Kind::frames_missing)));
  EXPECT_EQ(bench.samples().size(), 40U);
}

TEST(Loop, NotFiniteReadingsAreInvalidCountedAndReportedOnce) {
  Bench bench({.frames = 100, .ramp_s = 0.01});
  bench.driver.on_frame = [](Frame& frame) {
    if (frame.sequence >= 20 && frame.sequence < 30) {
      frame.value[index_of(Channel::velocity)] = std::numeric_limits<double>::quiet_NaN();
    }
  };
  bench.loop.run();
  EXPECT_EQ(bench.loop.timing().not_finite, 10U);
  const auto notices = bench.notices();
  EXPECT_EQ(std::count_if(notices.begin(), notices.end(),
                          [](const Notice& n) { return n.kind == Notice::Kind::not_finite; }),
            1);
  EXPECT_FALSE(bench.samples()[25].frame.has(Channel::velocity));
  EXPECT_EQ(bench.sink.samples[25].frame[Channel::velocity], 0.0);
  EXPECT_TRUE(bench.sink.samples[25].frame.has(Channel::displacement));
}

TEST(Loop, AChannelOutsideItsCalibratedRangeIsReportedOnceAndKept) {
  config::ChannelCalibrations channels;
  channels[index_of(Channel::velocity)].valid = config::ValidRange{-1.0, 30.0};
  LoopSettings settings;
  settings.frames = 100;
  settings.ramp_s = 0.01;
  settings.live.calibration = Calibration(channels);
  Bench bench(settings);
  bench.loop.run();  // the velocity is the frame's number plus 0.1
  const auto notices = bench.notices();
  EXPECT_EQ(std::count_if(notices.begin(), notices.end(),
                          [](const Notice& notice) {
                            return notice.kind == Notice::Kind::beyond_calibration &&
                                   notice.count == index_of(Channel::velocity);
                          }),
            1);
  EXPECT_TRUE(bench.samples()[60].frame.has(Channel::velocity));
}

TEST(Loop, NothingIsWrittenToADriverThatCannotDrive) {
  Bench bench({.frames = 50, .ramp_s = 0.01});
  bench.driver.description_.can_drive = false;
  Loop loop(bench.driver, bench.clock, {.frames = 50, .ramp_s = 0.01}, Excitation(shaking()),
            nullptr, bench.ledger, {});
  loop.run();
  EXPECT_EQ(bench.driver.writes, 0U);
}

TEST(Loop, AFreeRunningSourceWaitsForItsConsumersAndLosesNothing) {
  test::FakeDriver driver;
  driver.keep_actuations = false;
  MonotonicClock clock;
  test::FakeSink sink;
  sink.on_block = [](std::span<const Sample>) {
    std::this_thread::sleep_for(50us);
    return WriteResult::ok;
  };
  Ledger ledger;
  Stream stream(sink, ledger.recorded(), {.ring_frames = 64, .poll = 50us});
  Loop loop(driver, clock, {.pacing = Pacing::free_running, .frames = 5000, .ramp_s = 0.0},
            Excitation({}), nullptr, ledger, {&stream});
  stream.start();
  loop.run();
  stream.finish(10s);
  EXPECT_EQ(sink.samples.size(), 5000U);
  EXPECT_EQ(ledger.balance().recorded.lost_in_total(), 0U);
}

TEST(Loop, AFreeRunningSourceCanBeStoppedWhileItsSinkHangs) {
  test::FakeDriver driver;
  MonotonicClock clock;
  test::FakeSink sink;
  Ledger ledger;
  Stream stream(sink, ledger.recorded(), {.ring_frames = 64});  // never started: nothing drains it
  Loop loop(driver, clock, {.pacing = Pacing::free_running}, Excitation({}), nullptr, ledger,
            {&stream});
  std::thread stopper([&] {
    std::this_thread::sleep_for(50ms);
    loop.request_stop();
    loop.request_stop();
  });
  EXPECT_EQ(loop.run().reason, LoopEnd::Reason::requested);
  stopper.join();
  stream.finish(0s);
  EXPECT_TRUE(ledger.balance().is_closed());
}

}  // namespace
}  // namespace stickslip::daemon
