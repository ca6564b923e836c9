// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <thread>
#include <vector>

#include "drivers/bench/bench_driver.h"
#include "drivers/bench/probe_bench.h"
#include "drivers/faults/faulty_driver.h"

namespace stickslip::drivers {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr std::int64_t ms = 1'000'000;

/// Waits for `done`, at most two seconds; false on time-out.
template <class Done>
bool eventually(Done done) {
  const auto end = steady_clock::now() + milliseconds(2000);
  while (!done()) {
    if (steady_clock::now() > end) return false;
    std::this_thread::sleep_for(milliseconds(1));
  }
  return true;
}

struct FixedClock final : HostClock {
  std::int64_t now_ns() override { return now; }
  void sleep_until(std::int64_t) override {}
  std::int64_t now = 0;
};

/// State shared by a test and the gauge in its thread.
struct GaugeState {
  std::mutex mutex;
  std::vector<Reading> next;  // returned one per read
  Result open_answer{};
  Result read_answer{Outcome::no_data, ""};
  int opened = 0;
  int closed = 0;
  GaugeLosses losses;
  std::atomic<bool> fault{false};

  void add(double value, std::int64_t time_ns, bool valid = true, std::int64_t sigma_ns = 0) {
    const std::lock_guard lock(mutex);
    next.push_back({value, time_ns, valid, sigma_ns});
  }
  void answer(Result open, Result read) {
    const std::lock_guard lock(mutex);
    open_answer = open;
    read_answer = read;
  }
};

class FakeGauge final : public Gauge {
 public:
  explicit FakeGauge(GaugeState& state) : state_(state) {}
  const std::string& name() const override { return name_; }
  std::span<const GaugeInput> inputs() const override { return inputs_; }
  Result open() override {
    const std::lock_guard lock(state_.mutex);
    ++state_.opened;
    return state_.open_answer;
  }
  Result read(std::span<Reading> readings) override {
    std::this_thread::sleep_for(milliseconds(1));
    const std::lock_guard lock(state_.mutex);
    if (state_.next.empty()) return state_.read_answer;
    readings[0] = state_.next.front();
    state_.next.erase(state_.next.begin());
    return {};
  }
  void close() noexcept override {
    const std::lock_guard lock(state_.mutex);
    ++state_.closed;
  }
  GaugeLosses losses() const override {
    const std::lock_guard lock(state_.mutex);
    return state_.losses;
  }
  Signals signals() const noexcept override { return {.amplifier_fault = state_.fault.load()}; }

 private:
  GaugeState& state_;
  std::string name_ = "bridge 7";
  std::vector<GaugeInput> inputs_ = {{"bridge", "0", "V/V"}};
};

struct BoardState {
  std::vector<Frame> frames;
  std::vector<Actuation> writes;
  std::vector<std::string> order;  // of "board" and "contacts"
  Result open_answer{};
  Result write_answer{};
  Signals signals;
  bool own_clock = false;
  std::uint64_t count = 0;
  const char* left_on = nullptr;
};

class FakeBoard final : public Driver {
 public:
  explicit FakeBoard(BoardState& state) : state_(state) {
    description_.name = "board 3";
    description_.channels = 0b00001;
    description_.unit[0] = "V";
    description_.paced = true;
    description_.can_drive = true;
    description_.own_clock = state.own_clock;
  }
  Result open() override { return state_.open_answer; }
  Result start() override { return {}; }
  Result read(Frame& frame) override {
    if (state_.frames.empty()) return {Outcome::no_data, ""};
    frame = state_.frames.front();
    state_.frames.erase(state_.frames.begin());
    return {};
  }
  Result write(const Actuation& actuation) override {
    state_.writes.push_back(actuation);
    state_.order.emplace_back("board");
    return state_.write_answer;
  }
  void stop() noexcept override {}
  void close() noexcept override {}
  const Description& description() const override { return description_; }
  Signals signals() const noexcept override { return state_.signals; }
  const char* left_on() const noexcept override { return state_.left_on; }
  Counts counts() const noexcept override {
    Counts out;
    out.add({"board 3", "overruns", state_.count});
    return out;
  }

 private:
  BoardState& state_;
  Description description_;
};

struct ContactsState {
  std::vector<bool> writes;
  Signals signals;
  Result write_answer{};
  Result switch_off_answer{};
};

class FakeContacts final : public Contacts {
 public:
  FakeContacts(ContactsState& state, BoardState& board) : state_(state), board_(board) {}
  Result open() override {
    board_.order.emplace_back("contacts opened");
    return {};
  }
  Result write(bool on) override {
    state_.writes.push_back(on);
    board_.order.emplace_back("contacts");
    return state_.write_answer;
  }
  Result switch_off() override {
    state_.writes.push_back(false);
    return state_.switch_off_answer;
  }
  Signals signals() const noexcept override { return state_.signals; }
  void close() noexcept override {}

 private:
  ContactsState& state_;
  BoardState& board_;
};

constexpr RetryDelay quick{1 * ms, 2 * ms};

struct Bench {
  Bench() : driver(parts(), inputs(), {.volts_per_unit = 100.0}, quick) {}

  static config::BenchInputs inputs() {
    config::BenchInputs out;
    out[index_of(Channel::displacement)] = {.device = "board", .input = "AIN0"};
    out[index_of(Channel::normal_load)] = {.device = "bridge", .input = "0"};
    return out;
  }

  BenchParts parts() {
    BenchParts out;
    out.clock = std::make_unique<FixedClock>();
    out.board = std::make_unique<FakeBoard>(board);
    out.gauges.push_back(std::make_unique<FakeGauge>(gauge));
    out.amplifier = std::make_unique<FakeContacts>(contacts, board);
    return out;
  }
  Frame scan(std::int64_t time_ns, double volts) {
    Frame frame;
    frame.time_ns = time_ns;
    frame.set(Channel::displacement, volts);
    return frame;
  }
  /// The next frame with a reading of the gauge, once its thread has published it.
  Frame frame_after_gauge(std::int64_t time_ns) {
    Frame out;
    eventually([&] {
      board.frames = {scan(time_ns, 1.0)};
      return driver.read(out) && out.has(Channel::normal_load);
    });
    return out;
  }

  GaugeState gauge;
  BoardState board;
  ContactsState contacts;
  BenchDriver driver;
};

TEST(GaugeReader, ReturnsTheLatestReadingNotNewerThanTheScan) {
  GaugeState state;
  GaugeReader reader(std::make_unique<FakeGauge>(state), quick);
  ASSERT_TRUE(reader.open(true));
  EXPECT_FALSE(reader.latest(0, 100 * ms).valid);
  state.add(1.0, 10 * ms);
  state.add(2.0, 20 * ms);
  state.add(3.0, 30 * ms);
  // Readings newer than the scan are kept.
  for (int i = 0; i < 100; ++i) state.add(100.0 + i, (1000 + i) * ms);
  ASSERT_TRUE(eventually([&] {
    const std::lock_guard lock(state.mutex);
    return state.next.empty();
  }));
  EXPECT_FALSE(reader.latest(0, 9 * ms).valid);
  EXPECT_EQ(reader.latest(0, 29 * ms).value, 2.0);
  EXPECT_EQ(reader.latest(0, 30 * ms).value, 3.0);
  EXPECT_EQ(reader.latest(0, 999 * ms).value, 3.0);
  EXPECT_EQ(reader.latest(0, 1000 * ms).value, 100.0);
}

TEST(GaugeReader, InvalidReadingReplacesAValidOne) {
  GaugeState state;
  GaugeReader reader(std::make_unique<FakeGauge>(state), quick);
  ASSERT_TRUE(reader.open(true));
  state.add(1.0, 10 * ms);
  state.add(9.0, 20 * ms, false);
  ASSERT_TRUE(eventually([&] { return reader.latest(0, 30 * ms).time_ns == 20 * ms; }));
  EXPECT_FALSE(reader.latest(0, 30 * ms).valid);
}

TEST(GaugeReader, ReopensALostGaugeAndReportsTheLossMeanwhile) {
  GaugeState state;
  GaugeReader reader(std::make_unique<FakeGauge>(state), quick);
  EXPECT_NE(reader.lost(), nullptr);
  ASSERT_TRUE(reader.open(true));
  EXPECT_EQ(reader.lost(), nullptr);
  state.add(7.0, 30 * ms);
  ASSERT_TRUE(eventually([&] { return reader.latest(0, 50 * ms).valid; }));
  state.answer({Outcome::lost, "not there"}, {Outcome::lost, "unplugged"});
  ASSERT_TRUE(eventually([&] { return reader.lost() != nullptr; }));
  EXPECT_THAT(reader.lost(), testing::HasSubstr("bridge 7 is disconnected"));
  state.answer({Outcome::needs_attention, "no permission"}, {Outcome::no_data, ""});
  ASSERT_TRUE(eventually([&] {
    const char* words = reader.lost();
    return words != nullptr && std::string(words).find("cannot be used") != std::string::npos;
  }));
  state.answer({}, {Outcome::no_data, ""});
  EXPECT_TRUE(eventually([&] { return reader.lost() == nullptr; }));
  EXPECT_FALSE(reader.latest(0, 50 * ms).valid) << "readings before the loss";
  state.add(4.0, 40 * ms);
  EXPECT_TRUE(eventually([&] { return reader.latest(0, 50 * ms).value == 4.0; }));
}

TEST(GaugeReader, RetryDelayGrowsWhileAGaugeIsLostBeforeItsFirstReading) {
  GaugeState state;
  state.answer({}, {Outcome::lost, "unplugged"});
  GaugeReader reader(std::make_unique<FakeGauge>(state), {1 * ms, 10'000 * ms});
  ASSERT_TRUE(reader.open(true));
  std::this_thread::sleep_for(milliseconds(300));
  const std::lock_guard lock(state.mutex);
  EXPECT_GE(state.opened, 3);
  EXPECT_LE(state.opened, 10);  // after 1, 3, 7, ... 255 ms
}

TEST(GaugeReader, DoesNotReopenAfterAFatalFailure) {
  GaugeState state;
  GaugeReader reader(std::make_unique<FakeGauge>(state), quick);
  ASSERT_TRUE(reader.open(true));
  state.answer({}, {Outcome::fatal, "broken"});
  ASSERT_TRUE(eventually([&] { return reader.lost() != nullptr; }));
  EXPECT_THAT(reader.lost(), testing::HasSubstr("failed permanently"));
  std::this_thread::sleep_for(milliseconds(20));
  const std::lock_guard lock(state.mutex);
  EXPECT_EQ(state.opened, 1);
}

TEST(GaugeReader, AccumulatesLossesOverAllOpenings) {
  GaugeState state;
  GaugeReader reader(std::make_unique<FakeGauge>(state), quick);
  ASSERT_TRUE(reader.open(true));
  {
    const std::lock_guard lock(state.mutex);
    state.losses = {3, 1};
    state.read_answer = {Outcome::lost, "unplugged"};
    state.open_answer = {Outcome::lost, "not there"};
  }
  ASSERT_TRUE(eventually([&] { return reader.lost() != nullptr; }));
  {
    const std::lock_guard lock(state.mutex);
    state.losses = {2, 0};
    state.read_answer = {Outcome::no_data, ""};
    state.open_answer = {};
  }
  EXPECT_TRUE(
      eventually([&] { return reader.losses().missing == 5 && reader.losses().rejected == 1; }));
}

TEST(GaugeReader, KeepsTheLossesOfAClosedGauge) {
  GaugeState state;
  GaugeReader reader(std::make_unique<FakeGauge>(state), quick);
  for (const std::uint64_t times : {1U, 2U}) {
    ASSERT_TRUE(reader.open(true));
    {
      const std::lock_guard lock(state.mutex);
      state.losses = {4, 1};
    }
    ASSERT_TRUE(eventually([&] { return reader.losses().missing == 4 * times; }));
    reader.close();
    EXPECT_EQ(reader.losses().missing, 4 * times);
    EXPECT_EQ(reader.losses().rejected, times);
    const std::lock_guard lock(state.mutex);
    state.losses = {};
  }
}

/// Advances at every call.
struct SteppingClock final : HostClock {
  std::int64_t now_ns() override { return now += 10 * ms; }
  void sleep_until(std::int64_t) override {}
  std::int64_t now = 0;
};

std::vector<ProbedDevice> probe(Bench& bench) {
  BenchParts parts = bench.parts();
  parts.clock = std::make_unique<SteppingClock>();
  parts.amplifier.reset();
  config::Bench settings;
  settings.inputs = Bench::inputs();
  return probe_bench(std::move(parts), settings, 1.0);
}

// Also where the next open may succeed: the unit is busy, the checksum of a reply was wrong.
TEST(ProbeBench, NamesTheReasonOfAFailedOpen) {
  for (const Outcome outcome : {Outcome::temporary, Outcome::lost, Outcome::needs_attention}) {
    Bench bench;
    bench.board.open_answer = {outcome, "it does not identify itself"};
    bench.gauge.answer({outcome, "exception 6, device busy"},
                       {Outcome::fatal, "read of a unit that is not open"});
    const auto devices = probe(bench);
    ASSERT_EQ(devices.size(), 2U);
    EXPECT_FALSE(devices[0].ok);
    EXPECT_EQ(devices[0].message, "it does not identify itself");
    EXPECT_FALSE(devices[1].ok);
    EXPECT_EQ(devices[1].message, "exception 6, device busy");
  }
}

TEST(ProbeBench, NamesTheReasonOfMissingReadings) {
  Bench bench;
  bench.gauge.answer({}, {Outcome::temporary, "the checksum is wrong"});
  const auto devices = probe(bench);
  EXPECT_EQ(devices[0].message, "no valid reading from AIN0");
  EXPECT_EQ(devices[1].message, "no valid reading from 0: the checksum is wrong");
}

TEST(BenchDriver, ReturnsTheCountsOfBoardAndGauges) {
  Bench bench;
  bench.board.count = 3;
  ASSERT_TRUE(bench.driver.open());
  {
    const std::lock_guard lock(bench.gauge.mutex);
    bench.gauge.losses = {5, 2};
  }
  const auto text = [&] {
    std::string out;
    const Counts counts = bench.driver.counts();
    for (const Count& count : counts.all()) {
      out +=
          std::string(count.device) + ' ' + count.name + ' ' + std::to_string(count.value) + '\n';
    }
    return out;
  };
  EXPECT_TRUE(eventually([&] {
    return text() ==
           "board 3 overruns 3\nbridge 7 readings_missing 5\nbridge 7 readings_rejected 2\n"
           "bridge 7 age_sigma_us 0\n";
  })) << text();
}

TEST(Counts, ExcessCountsAreDropped) {
  Counts counts;
  for (std::uint64_t i = 0; i < 1000; ++i) counts.add({"board", "overruns", i});
  ASSERT_GT(counts.all().size(), 32U);
  ASSERT_LT(counts.all().size(), 1000U);
  EXPECT_EQ(counts.all().back().value, counts.all().size() - 1);
}

TEST(BenchDriver, FrameHoldsScanAndGaugesWithTheirAges) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open());
  EXPECT_EQ(bench.driver.description().channels, 0b01001);
  EXPECT_STREQ(bench.driver.description().unit[index_of(Channel::normal_load)], "V/V");
  EXPECT_EQ(bench.driver.description().name, "board 3, bridge 7");
  bench.gauge.add(0.25, 40 * ms, true, 300'000);
  const Frame frame = bench.frame_after_gauge(47 * ms);
  EXPECT_EQ(frame[Channel::displacement], 1.0);
  EXPECT_EQ(frame[Channel::normal_load], 0.25);
  EXPECT_EQ(frame.age_us[index_of(Channel::normal_load)], 7000);
  EXPECT_EQ(bench.driver.age_sigma_us()[index_of(Channel::normal_load)], 300);
  EXPECT_EQ(bench.driver.age_sigma_us()[index_of(Channel::displacement)], 0);
  EXPECT_EQ(frame.time_ns, 47 * ms);
}

TEST(BenchDriver, AgesAreInHostTimeIfTheBoardHasItsOwnClock) {
  GaugeState gauge;
  BoardState board;
  board.own_clock = true;
  BenchParts parts;
  auto host_clock = std::make_unique<FixedClock>();
  FixedClock& clock = *host_clock;
  parts.clock = std::move(host_clock);
  parts.board = std::make_unique<FakeBoard>(board);
  parts.gauges.push_back(std::make_unique<FakeGauge>(gauge));
  BenchDriver driver(std::move(parts), Bench::inputs(), {.volts_per_unit = 1.0}, quick);
  ASSERT_TRUE(driver.open());
  ASSERT_TRUE(driver.start());
  EXPECT_FALSE(driver.description().own_clock) << "frames are in host time";
  clock.now = 5'000 * ms;
  gauge.add(0.5, 4'998 * ms);
  std::this_thread::sleep_for(milliseconds(20));  // until its thread has read it
  Frame scan;
  scan.time_ns = 2 * ms;  // of the board, from 0
  scan.set(Channel::displacement, 1.0);
  board.frames = {scan};
  Frame frame;
  EXPECT_EQ(driver.read(frame).outcome, Outcome::no_data) << "its time is not known yet";
  ASSERT_TRUE(driver.read(frame));
  EXPECT_EQ(frame.time_ns, 5'000 * ms);
  EXPECT_NEAR(frame.age_us[index_of(Channel::normal_load)], 2000, 1);
}

TEST(BenchDriver, ConvertsTheDriveToVoltsWithinTheOutputRange) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open());
  ASSERT_TRUE(bench.driver.write({0.01, true}));
  ASSERT_TRUE(bench.driver.write({0.5, true}));
  ASSERT_TRUE(bench.driver.write({-0.5, true}));
  ASSERT_TRUE(bench.driver.write({0.01, false}));
  ASSERT_EQ(bench.board.writes.size(), 4U);
  EXPECT_DOUBLE_EQ(bench.board.writes[0].drive, 3.5);
  EXPECT_DOUBLE_EQ(bench.board.writes[1].drive, 5.0);
  EXPECT_DOUBLE_EQ(bench.board.writes[2].drive, 0.0);
  EXPECT_DOUBLE_EQ(bench.board.writes[3].drive, 2.5);
  EXPECT_FALSE(bench.board.writes[3].amplifier_on);
}

TEST(BenchDriver, ContactSwitchesOffBeforeTheOutputAndOnAfterIt) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open());
  bench.board.order.clear();
  ASSERT_TRUE(bench.driver.write({0.0, true}));
  ASSERT_TRUE(bench.driver.write({0.0, false}));
  EXPECT_THAT(bench.board.order, testing::ElementsAre("board", "contacts", "contacts", "board"));
  EXPECT_THAT(bench.contacts.writes, testing::ElementsAre(true, false));
}

TEST(BenchDriver, OffIsWrittenToBoardAndContactDespiteFailures) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open());
  bench.contacts.write_answer = {Outcome::lost, "the chip is disconnected"};
  EXPECT_EQ(bench.driver.write({0.0, false}).outcome, Outcome::lost);
  ASSERT_FALSE(bench.board.writes.empty());
  EXPECT_FALSE(bench.board.writes.back().amplifier_on);
  bench.contacts.write_answer = {};
  bench.board.write_answer = {Outcome::temporary, "no answer"};
  EXPECT_EQ(bench.driver.write({0.0, true}).outcome, Outcome::temporary);
  EXPECT_FALSE(bench.contacts.writes.back()) << "on, although the board rejected the drive";
  bench.board.write_answer = {};
  ASSERT_TRUE(bench.driver.write({0.0, true}));
  bench.board.write_answer = {Outcome::temporary, "one damaged reply"};
  EXPECT_EQ(bench.driver.write({0.0, true}).outcome, Outcome::temporary);
  EXPECT_TRUE(bench.contacts.writes.back()) << "switched off by a single failure";
  bench.board.write_answer = {Outcome::lost, "unplugged"};
  EXPECT_EQ(bench.driver.write({0.0, true}).outcome, Outcome::lost);
  EXPECT_FALSE(bench.contacts.writes.back());
  bench.board.write_answer = {};
  EXPECT_EQ(bench.driver.write({std::numeric_limits<double>::quiet_NaN(), true}).outcome,
            Outcome::fatal);
  EXPECT_FALSE(bench.board.writes.back().amplifier_on);
  EXPECT_FALSE(bench.contacts.writes.back());
}

TEST(BenchDriver, ContactLeftOnIsReported) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open());
  ASSERT_TRUE(bench.driver.write({0.0, true}));
  bench.driver.stop();
  EXPECT_EQ(bench.driver.left_on(), nullptr);
  bench.contacts.switch_off_answer = {Outcome::lost,
                                      "the amplifier's GPIO chip gpiochip1 is disconnected"};
  bench.driver.stop();
  ASSERT_NE(bench.driver.left_on(), nullptr);
  EXPECT_THAT(bench.driver.left_on(), testing::HasSubstr("gpiochip1 is disconnected"));
  EXPECT_THAT(bench.driver.left_on(), testing::HasSubstr("press the emergency stop"));
  bench.driver.close();
  EXPECT_NE(bench.driver.left_on(), nullptr);
  // Opening the contact's device switches it off.
  bench.contacts.switch_off_answer = {};
  ASSERT_TRUE(bench.driver.open());
  EXPECT_EQ(bench.driver.left_on(), nullptr);
}

TEST(BenchDriver, BoardLeftOnIsReported) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open());
  bench.board.left_on = "board 3 may still be on";
  bench.driver.stop();
  EXPECT_STREQ(bench.driver.left_on(), "board 3 may still be on");
}

/// A bench behind a fault script with noise, a drop and an unplug.
struct FaultyBench {
  FaultyBench() {
    BenchParts parts;
    parts.clock = std::make_unique<FixedClock>();
    parts.board = std::make_unique<FakeBoard>(board);
    parts.gauges.push_back(std::make_unique<FakeGauge>(gauge));
    parts.amplifier = std::make_unique<FakeContacts>(contacts, board);
    driver.emplace(
        std::make_unique<BenchDriver>(std::move(parts), Bench::inputs(),
                                      config::ShakerOutput{.volts_per_unit = 1.0}, quick),
        script(), Pace{}, clock);
  }

  static config::FaultScript script() {
    const auto fault = [](config::FaultKind kind, double at_s, double duration_s, double amount) {
      config::Fault out;
      out.kind = kind;
      out.from_s = out.to_s = at_s;
      out.duration_s = duration_s;
      out.amount = amount;
      return out;
    };
    config::FaultScript script;
    script.faults = {fault(config::FaultKind::noise, 0.010, 0.010, 0.1),
                     fault(config::FaultKind::drop, 0.030, 0.005, 0.0),
                     fault(config::FaultKind::unplug, 0.050, 0.020, 0.0)};
    script.faults[0].channel = Channel::displacement;
    return script;
  }

  Result read(std::int64_t number, Frame& frame) {
    Frame scan;
    scan.time_ns = number * ms;
    scan.sequence = static_cast<std::uint64_t>(number);
    scan.set(Channel::displacement, 1.0);
    board.frames = {scan};
    return driver->read(frame);
  }

  GaugeState gauge;
  BoardState board;
  ContactsState contacts;
  std::shared_ptr<FixedClock> clock = std::make_shared<FixedClock>();
  std::optional<FaultyDriver> driver;
};

TEST(BenchDriver, FaultInjectionWorksOnABench) {
  FaultyBench bench;
  FaultyDriver& faulty = *bench.driver;
  ASSERT_TRUE(faulty.open());
  EXPECT_THAT(faulty.description().name, testing::HasSubstr("board 3, bridge 7"));
  ASSERT_TRUE(faulty.start());
  ASSERT_TRUE(faulty.write({0.01, true}));
  ASSERT_TRUE(bench.contacts.writes.back());
  std::vector<std::uint64_t> noisy;
  std::vector<std::uint64_t> missing;
  Result result;
  for (std::int64_t i = 0; i < 50; ++i) {
    Frame frame;
    result = bench.read(i, frame);
    const auto number = static_cast<std::uint64_t>(i);
    if (!result) {
      EXPECT_EQ(result.outcome, Outcome::no_data) << i << ' ' << result.message;
      missing.push_back(number);
    } else if (frame[Channel::displacement] != 1.0) {
      noisy.push_back(number);
    }
  }
  using testing::ElementsAre;
  EXPECT_THAT(noisy, ElementsAre(10, 11, 12, 13, 14, 15, 16, 17, 18, 19));
  EXPECT_THAT(missing, ElementsAre(30, 31, 32, 33, 34));
  Frame frame;
  EXPECT_EQ(bench.read(50, frame).outcome, Outcome::lost);
  EXPECT_FALSE(bench.contacts.writes.back());
  EXPECT_FALSE(bench.board.writes.back().amplifier_on);
  const Counts counts = faulty.counts();
  EXPECT_EQ(counts.all().size(), 4U) << "of the wrapped device";
  // Closed and reopened as by the daemon after a loss.
  faulty.stop();
  faulty.close();
  int attempts = 0;
  while (!(result = faulty.open())) {
    ASSERT_EQ(result.outcome, Outcome::lost);
    ASSERT_LT(++attempts, 10);
    bench.clock->now += 5 * ms;
  }
  EXPECT_GE(attempts, 3);
  ASSERT_TRUE(faulty.start());
  ASSERT_TRUE(bench.read(100, frame));
  EXPECT_EQ(frame[Channel::displacement], 1.0);
}

TEST(BenchDriver, LostGaugeInvalidatesItsChannelsAndIsReported) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open());
  bench.gauge.add(0.25, 40 * ms);
  ASSERT_TRUE(bench.frame_after_gauge(47 * ms).has(Channel::normal_load));
  bench.gauge.answer({Outcome::lost, ""}, {Outcome::lost, ""});
  ASSERT_TRUE(eventually([&] { return bench.driver.signals().lost_device != nullptr; }));
  EXPECT_THAT(bench.driver.signals().lost_device, testing::HasSubstr("bridge 7"));
  Frame frame;
  bench.board.frames = {bench.scan(60 * ms, 1.0)};
  ASSERT_TRUE(bench.driver.read(frame));
  EXPECT_TRUE(frame.has(Channel::displacement));
  EXPECT_FALSE(frame.has(Channel::normal_load));
}

TEST(BenchDriver, FirstOpenNeedsAllDevicesReopeningOnlyTheBoard) {
  Bench bench;
  bench.gauge.answer({Outcome::needs_attention, "no permission on /dev/hidraw0"},
                     {Outcome::no_data, ""});
  const Result refused = bench.driver.open();
  EXPECT_EQ(refused.outcome, Outcome::needs_attention);
  EXPECT_STREQ(refused.message, "no permission on /dev/hidraw0");
  bench.gauge.answer({}, {Outcome::no_data, ""});
  ASSERT_TRUE(bench.driver.open());
  bench.driver.close();
  bench.gauge.answer({Outcome::lost, "not there"}, {Outcome::no_data, ""});
  ASSERT_TRUE(bench.driver.open());
  EXPECT_NE(bench.driver.signals().lost_device, nullptr);
}

TEST(BenchDriver, ContactDeviceIsOpenedBeforeTheBoardAndWithoutIt) {
  Bench bench;
  bench.board.open_answer = {Outcome::lost, "no board"};
  EXPECT_STREQ(bench.driver.open().message, "no board");
  ASSERT_FALSE(bench.board.order.empty());
  EXPECT_EQ(bench.board.order.front(), "contacts opened");
}

TEST(BenchDriver, UnknownInputIsReported) {
  GaugeState gauge;
  BoardState board;
  BenchParts parts;
  parts.clock = std::make_unique<FixedClock>();
  parts.board = std::make_unique<FakeBoard>(board);
  parts.gauges.push_back(std::make_unique<FakeGauge>(gauge));
  config::BenchInputs inputs = Bench::inputs();
  inputs[index_of(Channel::friction_force)] = {.device = "bridge", .input = "7"};
  BenchDriver driver(std::move(parts), inputs, {.volts_per_unit = 1.0}, quick);
  const Result refused = driver.open();
  EXPECT_EQ(refused.outcome, Outcome::needs_attention);
  EXPECT_THAT(refused.message, testing::HasSubstr("friction_force from bridge/7"));
}

TEST(BenchDriver, SignalsOfAllDevicesAreCombined) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open());
  EXPECT_FALSE(bench.driver.signals().emergency_stop);
  EXPECT_FALSE(bench.driver.signals().amplifier_fault);
  bench.contacts.signals.emergency_stop = true;
  EXPECT_TRUE(bench.driver.signals().emergency_stop);
  bench.gauge.fault = true;
  EXPECT_TRUE(bench.driver.signals().amplifier_fault);
  bench.contacts.signals.emergency_stop = false;
  bench.board.signals.emergency_stop = true;
  EXPECT_TRUE(bench.driver.signals().emergency_stop);
}

}  // namespace
}  // namespace stickslip::drivers
