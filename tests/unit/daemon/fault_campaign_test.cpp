// SPDX-License-Identifier: Apache-2.0
// Every fault of a fault script, at many moments, in every state of the rig. The expected reaction
// is derived from the device's answers alone, independently of the daemon.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "config/fault_script.h"
#include "daemon/device_supervisor.h"
#include "daemon/loop.h"
#include "drivers/faults/faulty_driver.h"
#include "tests/unit/daemon/fakes.h"

namespace stickslip::daemon {
namespace {

using config::Fault;
using config::FaultKind;
using drivers::Outcome;
using drivers::Result;

constexpr std::int64_t ms = 1'000'000;
constexpr double limit = 2.0;  // of every channel, SI
constexpr std::int64_t silence_ns = 20 * ms;
constexpr std::int64_t stale_ns = 25 * ms;
constexpr std::int64_t overrun_ns = 5 * ms;

/// The loop's clock for the fault decorator.
class SharedClock final : public drivers::HostClock {
 public:
  explicit SharedClock(test::FakeClock& clock) : clock_(clock) {}
  std::int64_t now_ns() override { return clock_.now; }
  void sleep_until(std::int64_t due_ns) override { clock_.sleep_until(due_ns); }

 private:
  test::FakeClock& clock_;
};

/// Forwards to a device owned by the test.
class Borrowed final : public drivers::Driver {
 public:
  explicit Borrowed(drivers::Driver& device) : device_(device) {}
  Result open() override { return device_.open(); }
  Result start() override { return device_.start(); }
  Result read(Frame& frame) override { return device_.read(frame); }
  Result write(const drivers::Actuation& actuation) override { return device_.write(actuation); }
  void stop() noexcept override { device_.stop(); }
  void close() noexcept override { device_.close(); }
  const drivers::Description& description() const override { return device_.description(); }

 private:
  drivers::Driver& device_;
};

/// Between the loop and the faulty device: derives from the device's answers when the amplifier has
/// to be off.
class Witness final : public drivers::Driver {
 public:
  Witness(drivers::Driver& device, test::FakeClock& clock) : device_(device), clock_(clock) {}
  Result open() override { return device_.open(); }
  Result start() override {
    reads_silent_since_ = writes_silent_since_ = -1;
    return device_.start();
  }
  Result read(Frame& frame) override {
    const std::int64_t start_ns = clock_.now;
    const Result result = device_.read(frame);
    must_be_off = false;
    good_in_a_row = result ? good_in_a_row + 1 : 0;
    judge(result, reads_silent_since_);
    if (clock_.now - start_ns > overrun_ns + ms) must_be_off = true;  // the next cycle is late
    const drivers::Signals lines = device_.signals();
    if (lines.emergency_stop || lines.amplifier_fault) must_be_off = true;
    if (lines.differing_output.name != nullptr) must_be_off = true;
    if (!result) return result;
    ++yielded;
    for (const Channel channel : all_channels) {
      if (!frame.has(channel)) continue;
      const double value = frame[channel];
      if (!(std::abs(value) <= limit)) must_be_off = true;
      if (frame.age_us[index_of(channel)] > stale_ns / 1000) must_be_off = true;
    }
    return result;
  }
  Result write(const drivers::Actuation& actuation) override {
    const Result result = device_.write(actuation);
    if (!result) good_in_a_row = 0;
    judge(result, writes_silent_since_);
    return result;
  }
  void stop() noexcept override { device_.stop(); }
  void close() noexcept override { device_.close(); }
  const drivers::Description& description() const override { return device_.description(); }
  drivers::Signals signals() const noexcept override { return device_.signals(); }

  bool must_be_off = false;
  std::uint64_t yielded = 0;
  int good_in_a_row = 0;  ///< cycles

 private:
  void judge(const Result& result, std::int64_t& silent_since) {
    switch (result.outcome) {
      case Outcome::ok:
      case Outcome::end_of_data:
        silent_since = -1;
        return;
      case Outcome::no_data:
      case Outcome::temporary:
        if (silent_since < 0) silent_since = clock_.now;
        if (clock_.now - silent_since >= silence_ns) must_be_off = true;
        return;
      default:
        must_be_off = true;
    }
  }

  drivers::Driver& device_;
  test::FakeClock& clock_;
  std::int64_t reads_silent_since_ = -1;
  std::int64_t writes_silent_since_ = -1;
};

Fault fault_of(FaultKind kind, bool variant, double at_s, double duration_s, std::mt19937& random) {
  Fault fault;
  fault.kind = kind;
  fault.from_s = fault.to_s = at_s;
  fault.duration_s = duration_s;
  const bool channelled =
      kind <= FaultKind::delay || kind == FaultKind::saturate || kind == FaultKind::nan;
  if (channelled && random() % 2 == 0) {
    fault.channel = all_channels.at(random() % channel_count);
  }
  switch (kind) {
    case FaultKind::noise:
      fault.amount = variant ? 5.0 : 0.01;
      break;
    case FaultKind::drift:
      fault.amount = variant ? 200.0 : 0.1;
      break;
    case FaultKind::delay:
      fault.amount = 0.04;
      fault.reported = variant;
      break;
    case FaultKind::saturate:
      fault.amount = 0.1;
      break;
    case FaultKind::clock_jump:
      fault.amount = variant ? -3.0 : 3600.0;
      break;
    case FaultKind::stall:
      fault.amount = 0.05;
      fault.duration_s = fault.amount;  // as the script's loader sets it
      fault.stall_blocking = variant;
      break;
    case FaultKind::drop:
    case FaultKind::duplicate:
    case FaultKind::reorder:
    case FaultKind::nan:
    case FaultKind::read_error:
    case FaultKind::write_error:
      fault.probability = variant ? 1.0 : 0.2;
      break;
    default:
      break;
  }
  return fault;
}

struct Tally {
  int runs = 0;
  int switched_off = 0;  ///< runs in which the amplifier had to go off while it was on
  int latest = 0;        ///< longest time that this took [cycles]
};

config::Excitation shaking(RigState state) {
  config::Excitation out;
  out.enabled = true;
  out.amplitude = 0.01;
  out.ramp_s = state == RigState::stopping ? 2.0 : 0.005;
  return out;
}

LoopSettings with_interlocks() {
  LoopSettings out;
  out.live.interlocks.longest_silence_ns = silence_ns;
  out.live.interlocks.stale_after_ns = stale_ns;
  out.live.interlocks.longest_overrun_ns = overrun_ns;
  out.live.interlocks.not_finite = true;
  out.live.interlocks.range.fill({-limit, limit});
  return out;
}

/// A device that yields sines, with one fault.
class FaultyRig {
 public:
  FaultyRig(FaultKind kind, bool variant, std::uint32_t seed) {
    std::mt19937 random(seed);
    device.keep_actuations = false;
    device.on_frame = [](Frame& frame) {
      for (const Channel channel : all_channels) {
        frame.set(channel, std::sin(0.02 * static_cast<double>(frame.sequence) +
                                    static_cast<double>(index_of(channel))));
      }
    };
    config::FaultScript script;
    script.file = "campaign.toml";
    script.seed = seed;
    const double at_s = 0.040 + 0.001 * static_cast<double>(random() % 60);
    script.faults.push_back(fault_of(kind, variant, at_s, 0.060, random));
    faulty = std::make_unique<drivers::FaultyDriver>(std::make_unique<Borrowed>(device), script,
                                                     drivers::Pace{},
                                                     std::make_shared<SharedClock>(clock));
    EXPECT_TRUE(faulty->open());
    witness = std::make_unique<Witness>(*faulty, clock);
  }

  test::FakeClock clock;
  test::FakeDriver device;
  std::unique_ptr<drivers::FaultyDriver> faulty;
  std::unique_ptr<Witness> witness;
};

/// One run: to `state`, the fault, its end, and back to running.
class CampaignRun {
 public:
  CampaignRun(FaultKind kind, bool variant, RigState state, std::uint32_t seed)
      : state_(state), rig_(kind, variant, seed) {
    stream_.start();
  }

  void operator()(Tally& tally) {
    ASSERT_TRUE(loop_.begin());
    // The script's time pauses while the device is lost: the duration is not known in advance.
    for (int i = 0; recovered_ == 0 || i < recovered_ + 30; ++i) {
      ASSERT_LT(i, 2000) << "script time " << rig_.faulty->script_time_ns() << ", "
                         << loop_.snapshot().broken_cause.c_str();
      step(i, tally);
      if (testing::Test::HasFatalFailure()) return;
    }
    expect_running();
    loop_.end();
    EXPECT_FALSE(rig_.device.last.amplifier_on);
    stream_.finish(std::chrono::seconds(10));
    Answer answer;
    while (loop_.next_answer(answer)) {
    }
    expect_balanced_accounts();
    ++tally.runs;
  }

 private:
  void ask(Command::Kind kind) {
    Command command;
    command.kind = kind;
    loop_.ask(command);
  }

  void step(int i, Tally& tally) {
    bring_to_state(i);
    if (i == 38) {
      ASSERT_EQ(loop_.snapshot().state, state_);
    }
    if (i >= 200 && loop_.device_lost()) {
      ASSERT_TRUE(DeviceSupervisor::try_to_restore(*rig_.witness, loop_, [] {}));
    }
    bring_back(i);
    const bool was_on = rig_.device.last.amplifier_on;
    loop_.wait();
    ASSERT_TRUE(loop_.cycle());
    rig_.clock.now += 10'000;
    check_amplifier(i, was_on, tally);
  }

  void bring_to_state(int i) {
    using enum Command::Kind;
    if (i == 2 && state_ != RigState::faulted) ask(clear);
    if (i == 4 && state_ != RigState::faulted && state_ != RigState::idle) ask(arm);
    if (i == 6 && (state_ == RigState::running || state_ == RigState::stopping)) ask(start);
    if (i == 30 && state_ == RigState::stopping) ask(stop);
  }

  // After any fault, an operator brings the rig back to running, without a restart.
  void bring_back(int i) {
    using enum Command::Kind;
    if (recovered_ == 0 && i >= 200 && rig_.witness->good_in_a_row >= 8 &&
        rig_.faulty->script_time_ns() > 170 * ms && !rig_.witness->must_be_off) {
      recovered_ = i;
    }
    if (recovered_ > 0 && i == recovered_ + 2) ask(clear);
    if (recovered_ > 0 && i == recovered_ + 4) ask(arm);
    if (recovered_ > 0 && i == recovered_ + 6) ask(start);
  }

  void check_amplifier(int i, bool was_on, Tally& tally) {
    if (!rig_.witness->must_be_off) {
      cycles_to_be_off_ = 0;
      return;
    }
    if (cycles_to_be_off_ == 0 && was_on) ++tally.switched_off;
    ++cycles_to_be_off_;
    const bool is_on = rig_.device.last.amplifier_on;
    if (is_on) {
      tally.latest = std::max(tally.latest, cycles_to_be_off_ + 1);
    } else if (was_on) {
      tally.latest = std::max(tally.latest, cycles_to_be_off_);
    }
    ASSERT_FALSE(is_on && cycles_to_be_off_ >= 2) << "cycle " << i;
  }

  void expect_running() const {
    // A rig whose ramp takes 2 s is still ramping down, if nothing stopped it.
    const RigState now = loop_.snapshot().state;
    if (state_ == RigState::stopping && now == RigState::stopping) return;
    EXPECT_EQ(now, RigState::running) << loop_.snapshot().cause.c_str();
    EXPECT_TRUE(rig_.device.last.amplifier_on);
  }

  // Of the device, the decorator, the daemon and the sink.
  void expect_balanced_accounts() const {
    EXPECT_TRUE(ledger_.balance().is_closed());
    EXPECT_EQ(ledger_.balance().recorded.lost_in_total(), 0U);
    EXPECT_TRUE(rig_.faulty->account().balances());
    EXPECT_EQ(rig_.witness->yielded, ledger_.balance().produced + loop_.timing().repeated);
    EXPECT_EQ(sink_.samples.size(), ledger_.balance().produced);
    for (std::size_t i = 1; i < sink_.samples.size(); ++i) {
      ASSERT_GT(sink_.samples[i].frame.sequence, sink_.samples[i - 1].frame.sequence);
      ASSERT_GT(sink_.samples[i].frame.time_ns, sink_.samples[i - 1].frame.time_ns);
    }
  }

  RigState state_;
  FaultyRig rig_;
  test::FakeSink sink_;
  Ledger ledger_;
  Stream stream_{
      sink_, ledger_.recorded(), {.ring_frames = 1024, .poll = std::chrono::microseconds(20)}};
  Loop loop_{*rig_.witness, rig_.clock, with_interlocks(), Excitation(shaking(state_)),
             nullptr,       ledger_,    {&stream_}};
  int cycles_to_be_off_ = 0;  // since the amplifier had to be off
  int recovered_ = 0;         // cycle in which the fault is over
};

class Campaign : public testing::TestWithParam<int> {};

TEST_P(Campaign, TheAmplifierIsOffWithinTwoCyclesTheAccountsBalanceAndAnOperatorRecovers) {
  const auto kind = static_cast<FaultKind>(GetParam());
  for (const RigState state : {RigState::faulted, RigState::idle, RigState::armed,
                               RigState::running, RigState::stopping}) {
    for (const bool variant : {false, true}) {
      Tally tally;
      for (std::uint32_t seed = 1; seed <= 100; ++seed) {
        CampaignRun(kind, variant, state, seed)(tally);
        ASSERT_FALSE(HasFatalFailure() || HasNonfatalFailure())
            << name_of(state) << ", variant " << variant << ", seed " << seed;
      }
      EXPECT_EQ(tally.runs, 100);
      EXPECT_LE(tally.latest, 2);
      RecordProperty(std::string(name_of(state)) + (variant ? "_strong" : "_weak"),
                     std::to_string(tally.switched_off) + " switched off, within " +
                         std::to_string(tally.latest) + " cycles");
    }
  }
}

const char* const kind_names[] = {"noise",
                                  "stick",
                                  "drift",
                                  "delay",
                                  "drop",
                                  "duplicate",
                                  "reorder",
                                  "saturate",
                                  "nan",
                                  "clock_jump",
                                  "unplug",
                                  "stall",
                                  "emergency_stop",
                                  "amplifier_fault",
                                  "output_differs",
                                  "read_error",
                                  "write_error"};

INSTANTIATE_TEST_SUITE_P(Faults, Campaign,
                         testing::Range(0, static_cast<int>(config::fault_kind_count)),
                         [](const auto& each) { return std::string(kind_names[each.param]); });

}  // namespace
}  // namespace stickslip::daemon
