// Every fault that a script knows, at many moments, in every state of the rig. What must follow is
// told by the device's own answers, not by the daemon's opinion of them.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "config/fault_script.h"
#include "daemon/device_keeper.h"
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

/// The loop's clock as the decorator sees it.
class SharedClock final : public drivers::HostClock {
 public:
  explicit SharedClock(test::FakeClock& clock) : clock_(clock) {}
  std::int64_t now_ns() override { return clock_.now; }
  void sleep_until(std::int64_t due_ns) override { clock_.sleep_until(due_ns); }

 private:
  test::FakeClock& clock_;
};

/// Keeps a device that somebody else owns.
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

/// Stands between the loop and the faulty device and notes, by rules of its own, from which moment
/// on the amplifier has to be off.
class Witness final : public drivers::Driver {
 public:
  Witness(drivers::Driver& device, test::FakeClock& clock) : device_(device), clock_(clock) {}
  Result open() override { return device_.open(); }
  Result start() override {
    reads_silent_since_ = writes_silent_since_ = -1;
    return device_.start();
  }
  Result read(Frame& frame) override {
    const std::int64_t asked_ns = clock_.now;
    const Result result = device_.read(frame);
    must_be_off = false;
    good_in_a_row = result ? good_in_a_row + 1 : 0;
    heed(result, reads_silent_since_);
    if (clock_.now - asked_ns > overrun_ns + ms) must_be_off = true;  // the next cycle comes late
    const drivers::Signals lines = device_.signals();
    if (lines.emergency_stop || lines.amplifier_fault) must_be_off = true;
    if (!result) return result;
    ++given;
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
    heed(result, writes_silent_since_);
    return result;
  }
  void stop() noexcept override { device_.stop(); }
  void close() noexcept override { device_.close(); }
  const drivers::Description& description() const override { return device_.description(); }
  drivers::Signals signals() const noexcept override { return device_.signals(); }

  bool must_be_off = false;
  std::uint64_t given = 0;
  int good_in_a_row = 0;  ///< cycles

 private:
  void heed(const Result& result, std::int64_t& silent_since) {
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

Fault fault_of(FaultKind kind, bool variant, double at_s, double duration_s, std::mt19937& dice) {
  Fault fault;
  fault.kind = kind;
  fault.from_s = fault.to_s = at_s;
  fault.duration_s = duration_s;
  const bool channelled =
      kind <= FaultKind::delay || kind == FaultKind::saturate || kind == FaultKind::nan;
  if (channelled && dice() % 2 == 0) {
    fault.channel = all_channels.at(dice() % channel_count);
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
      fault.duration_s = fault.amount;  // as a script's reader has it
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
  int off = 0;     ///< in which the amplifier had to go off while it was on
  int latest = 0;  ///< cycles that this took at most
};

class Campaign : public testing::TestWithParam<int> {
 protected:
  /// One run: to `state`, the fault, its end, and back to moving.
  void run(FaultKind kind, bool variant, RigState state, std::uint32_t seed, Tally& tally);
};

void Campaign::run(FaultKind kind, bool variant, RigState state, std::uint32_t seed, Tally& tally) {
  std::mt19937 dice(seed);
  test::FakeClock clock;
  test::FakeDriver device;
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
  const double at_s = 0.040 + 0.001 * static_cast<double>(dice() % 60);
  script.faults.push_back(fault_of(kind, variant, at_s, 0.060, dice));
  auto faulty = std::make_unique<drivers::FaultyDriver>(std::make_unique<Borrowed>(device), script,
                                                        drivers::Pace{},
                                                        std::make_shared<SharedClock>(clock));
  ASSERT_TRUE(faulty->open());
  Witness witness(*faulty, clock);

  config::Excitation shaking;
  shaking.enabled = true;
  shaking.amplitude = 0.01;
  shaking.ramp_s = state == RigState::stopping ? 2.0 : 0.005;
  LoopSettings settings;
  settings.live.interlocks.longest_silence_ns = silence_ns;
  settings.live.interlocks.stale_after_ns = stale_ns;
  settings.live.interlocks.longest_overrun_ns = overrun_ns;
  settings.live.interlocks.not_finite = true;
  settings.live.interlocks.range.fill({-limit, limit});
  test::FakeSink sink;
  Ledger ledger;
  Stream stream(sink, ledger.recorded(),
                {.ring_frames = 1024, .poll = std::chrono::microseconds(20)});
  stream.start();
  Loop loop(witness, clock, settings, Excitation(shaking), nullptr, ledger, {&stream});
  ASSERT_TRUE(loop.begin());

  const auto ask = [&loop](Command::Kind what) {
    Command command;
    command.kind = what;
    loop.ask(command);
  };
  using enum Command::Kind;
  int on_for = 0;  // cycles since the amplifier had to be off
  bool was_on = false;
  // The script's time stands still while the device is gone: how long it takes is not known before.
  int mended = 0;  // the cycle in which all is well again
  for (int i = 0; mended == 0 || i < mended + 30; ++i) {
    ASSERT_LT(i, 2000) << "script time " << faulty->script_time_ns() << ", "
                       << loop.snapshot().broken_cause.c_str();
    if (i == 2 && state != RigState::faulted) ask(clear);
    if (i == 4 && state != RigState::faulted && state != RigState::idle) ask(arm);
    if (i == 6 && (state == RigState::running || state == RigState::stopping)) ask(start);
    if (i == 30 && state == RigState::stopping) ask(stop);
    if (i == 38) {
      ASSERT_EQ(loop.snapshot().state, state);
    }
    if (i >= 200 && loop.device_is_gone()) {
      ASSERT_TRUE(DeviceKeeper::try_to_bring_back(witness, loop, [] {}));
    }
    // Whatever it was, a person brings the rig back to moving, without a restart.
    if (mended == 0 && i >= 200 && witness.good_in_a_row >= 8 &&
        faulty->script_time_ns() > 170 * ms && !witness.must_be_off) {
      mended = i;
    }
    if (mended > 0 && i == mended + 2) ask(clear);
    if (mended > 0 && i == mended + 4) ask(arm);
    if (mended > 0 && i == mended + 6) ask(start);
    was_on = device.last.amplifier_on;
    loop.wait();
    ASSERT_TRUE(loop.cycle());
    clock.now += 10'000;
    if (witness.must_be_off) {
      if (on_for == 0 && was_on) ++tally.off;
      ++on_for;
      if (device.last.amplifier_on) {
        tally.latest = std::max(tally.latest, on_for + 1);
      } else if (was_on) {
        tally.latest = std::max(tally.latest, on_for);
      }
      ASSERT_FALSE(device.last.amplifier_on && on_for >= 2) << "cycle " << i;
    } else {
      on_for = 0;
    }
  }
  // A rig whose ramp takes 2 s is still coming down, if nothing stopped it.
  const RigState now = loop.snapshot().state;
  if (state != RigState::stopping || now != RigState::stopping) {
    EXPECT_EQ(now, RigState::running) << loop.snapshot().cause.c_str();
    EXPECT_TRUE(device.last.amplifier_on);
  }
  loop.end();
  EXPECT_FALSE(device.last.amplifier_on);
  stream.finish(std::chrono::seconds(10));
  Answer answer;
  while (loop.next_answer(answer)) {
  }

  // The books: of the device, of the decorator, of the daemon, and what the sink holds.
  EXPECT_TRUE(ledger.balance().is_closed());
  EXPECT_EQ(ledger.balance().recorded.lost_in_total(), 0U);
  EXPECT_TRUE(faulty->account().balances());
  EXPECT_EQ(witness.given, ledger.balance().produced + loop.timing().repeated);
  EXPECT_EQ(sink.samples.size(), ledger.balance().produced);
  for (std::size_t i = 1; i < sink.samples.size(); ++i) {
    ASSERT_GT(sink.samples[i].frame.sequence, sink.samples[i - 1].frame.sequence);
    ASSERT_GT(sink.samples[i].frame.time_ns, sink.samples[i - 1].frame.time_ns);
  }
  ++tally.runs;
}

TEST_P(Campaign, TheAmplifierIsOffWithinTwoCyclesTheBooksBalanceAndAPersonBringsItBack) {
  const auto kind = static_cast<FaultKind>(GetParam());
  for (const RigState state : {RigState::faulted, RigState::idle, RigState::armed,
                               RigState::running, RigState::stopping}) {
    for (const bool variant : {false, true}) {
      Tally tally;
      for (std::uint32_t seed = 1; seed <= 100; ++seed) {
        run(kind, variant, state, seed, tally);
        ASSERT_FALSE(HasFatalFailure() || HasNonfatalFailure())
            << name_of(state) << ", variant " << variant << ", seed " << seed;
      }
      EXPECT_EQ(tally.runs, 100);
      EXPECT_LE(tally.latest, 2);
      RecordProperty(std::string(name_of(state)) + (variant ? "_strong" : "_weak"),
                     std::to_string(tally.off) + " switched off, within " +
                         std::to_string(tally.latest) + " cycles");
    }
  }
}

const char* const kind_names[] = {
    "noise",          "stick",           "drift",      "delay",      "drop",   "duplicate",
    "reorder",        "saturate",        "nan",        "clock_jump", "unplug", "stall",
    "emergency_stop", "amplifier_fault", "read_error", "write_error"};

INSTANTIATE_TEST_SUITE_P(Faults, Campaign,
                         testing::Range(0, static_cast<int>(config::fault_kind_count)),
                         [](const auto& each) { return std::string(kind_names[each.param]); });

}  // namespace
}  // namespace stickslip::daemon
