// SPDX-License-Identifier: Apache-2.0
// The real driver and library with units on a pseudo-terminal and a TCP port.
#include "drivers/modbus/modbus_unit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "config/rig.h"
#include "tests/emulated/modbus/emulated_modbus_units.h"

namespace stickslip::emulated {
namespace {

using config::ByteOrder;
using config::ModbusRegister;
using config::ModbusTransport;
using config::RegisterRole;
using config::RegisterTable;
using config::RegisterType;
using drivers::Gauge;
using drivers::Outcome;
using drivers::Reading;
using drivers::Result;
using testing::HasSubstr;

constexpr std::int64_t ms = 1'000'000;
constexpr double slope = 1.0;  // [1/s]: a value shows the time of its measurement
constexpr double apart = 1000.0;

/// Every channel grows, with offsets of a thousand, so that a value of another channel or time is
/// recognized.
class Climbing final : public Wires {
 public:
  explicit Climbing(std::int64_t begin_ns) : begin_ns_(begin_ns) {}
  double truth(Channel channel, std::int64_t time_ns) override {
    return apart * static_cast<double>(index_of(channel)) +
           slope * static_cast<double>(time_ns - begin_ns_) * 1e-9;
  }
  void drive(double, std::int64_t) override {}
  void enable(bool, std::int64_t) override {}

 private:
  std::int64_t begin_ns_;
};

ModbusRegister reg(std::string name, int address, RegisterType type,
                   RegisterTable table = RegisterTable::holding_registers) {
  ModbusRegister out;
  out.name = std::move(name);
  out.address = address;
  out.type = type;
  out.table = table;
  return out;
}

Parameter at(int address, Kind kind, std::string order = "ABCD", Table table = Table::holding) {
  Parameter parameter;
  parameter.address = address;
  parameter.kind = kind;
  parameter.order = std::move(order);
  parameter.table = table;
  return parameter;
}

Parameter constant(int address, Kind kind, double number, Table table = Table::holding) {
  Parameter parameter = at(address, kind, "ABCD", table);
  parameter.number = [number](std::int64_t) { return number; };
  return parameter;
}

class ModbusBench : public testing::TestWithParam<ModbusTransport> {
 protected:
  ModbusBench()
      : folder_(std::filesystem::temp_directory_path() /
                ("stickslip-modbus-" + std::to_string(::getpid()))),
        wires_(clock_.now_ns()),
        units_([this] { return clock_.now_ns(); }, folder_, 1) {}
  ~ModbusBench() override {
    gauges_.clear();
    std::filesystem::remove_all(folder_);
  }

  config::ModbusUnit settings(int unit) const {
    config::ModbusUnit out;
    out.name = "u" + std::to_string(unit);
    out.unit = unit;
    out.transport = GetParam();
    out.port = tcp() ? units_.tcp_port() : units_.serial_port();
    out.baud = 115200;
    out.timeout_s = 0.25;  // test hosts are busy
    out.retries = 2;
    out.poll_period_s = 0.005;
    out.map.name = "test unit";
    return out;
  }
  bool tcp() const { return GetParam() == ModbusTransport::tcp; }

  /// Channel i of the bench is assigned to inputs[i].
  Gauge& make(const std::vector<config::ModbusUnit>& units,
              const std::vector<std::pair<std::string, std::string>>& inputs = {}) {
    config::BenchInputs from{};
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      from[i] = config::BenchInput{.device = inputs[i].first, .input = inputs[i].second};
    }
    gauges_ = drivers::make_modbus_gauges(units, from, clock_);
    return *gauges_.front();
  }

  Parameter sensor(Parameter parameter, Channel channel, double resolution = 1.0) {
    return measured(std::move(parameter), Sensor{channel, 1.0, 0.0}, wires_, resolution);
  }

  /// Reads until an outcome other than no_data and temporary, or until the time is over.
  Result patiently(Gauge& gauge, std::span<Reading> readings, double seconds = 20.0) {
    const std::int64_t end = clock_.now_ns() + static_cast<std::int64_t>(seconds * 1e9);
    Result result;
    do {
      result = gauge.read(readings);
    } while ((result.outcome == Outcome::no_data || result.outcome == Outcome::temporary) &&
             clock_.now_ns() < end);
    return result;
  }

  // Repeats an opening that fails: a reply may be late on a busy host.
  Result patiently_opened(Gauge& gauge) {
    const std::int64_t end = clock_.now_ns() + 20'000 * ms;
    Result result = gauge.open();
    while (!result && clock_.now_ns() < end) {
      clock_.sleep_until(clock_.now_ns() + 20 * ms);
      result = gauge.open();
    }
    return result;
  }

  drivers::MonotonicHostClock clock_;
  std::filesystem::path folder_;
  Climbing wires_;
  EmulatedModbusUnits units_;
  std::vector<std::unique_ptr<Gauge>> gauges_;
};

INSTANTIATE_TEST_SUITE_P(Lines, ModbusBench,
                         testing::Values(ModbusTransport::rtu, ModbusTransport::tcp),
                         [](const auto& info) {
                           return info.param == ModbusTransport::rtu ? "Rtu" : "Tcp";
                         });

TEST_P(ModbusBench, EveryTypeAndOrderIsRead) {
  const std::pair<ByteOrder, const char*> orders[] = {{ByteOrder::abcd, "ABCD"},
                                                      {ByteOrder::cdab, "CDAB"},
                                                      {ByteOrder::badc, "BADC"},
                                                      {ByteOrder::dcba, "DCBA"}};
  const struct {
    RegisterType type;
    Kind kind;
    double number;
  } kinds[] = {{RegisterType::uint16, Kind::u16, 40000.0},
               {RegisterType::int16, Kind::i16, -12345.0},
               {RegisterType::uint32, Kind::u32, 3000000000.0},
               {RegisterType::int32, Kind::i32, -70000.0},
               {RegisterType::int64, Kind::i64, -1234567890123.0},
               {RegisterType::float32, Kind::f32, -0.015625},
               {RegisterType::float64, Kind::f64, 1.0 / 3.0},
               {RegisterType::bcd16, Kind::bcd16, 9081.0},
               {RegisterType::bcd32, Kind::bcd32, 90817263.0}};
  std::vector<Parameter> parameters;
  std::vector<ModbusRegister> registers;
  std::vector<double> expected;
  for (const auto& [order, letters] : orders) {
    for (const auto& kind : kinds) {
      const int address = 10 * static_cast<int>(registers.size());
      Parameter parameter = constant(address, kind.kind, kind.number, Table::input);
      parameter.order = letters;
      parameters.push_back(parameter);
      registers.push_back(reg("r" + std::to_string(registers.size()), address, kind.type,
                              RegisterTable::input_registers));
      registers.back().order = order;
      expected.push_back(kind.number);
    }
  }
  units_.add(1, {}, parameters);
  units_.start();
  // A bench has only a few channels: one gauge at a time.
  for (std::size_t i = 0; i < registers.size(); ++i) {
    config::ModbusUnit unit = settings(1);
    unit.map.registers = registers;
    Gauge& gauge = make({unit}, {{"u1", registers[i].name}});
    Result result = gauge.open();
    ASSERT_TRUE(result) << result.message;
    Reading readings[1];
    result = patiently(gauge, readings);
    ASSERT_TRUE(result) << result.message;
    EXPECT_TRUE(readings[0].valid);
    EXPECT_EQ(readings[0].value, expected[i]) << "register " << i;
  }
  EXPECT_EQ(units_.nonsense(), 0U);
}

TEST_P(ModbusBench, OrbitIsReadByItsFloatMirror) {
  units_.add(
      1, orbit_rules(),
      {sensor(at(100, Kind::i32), Channel::friction_force, 1e-4), constant(110, Kind::u16, 0)});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("position", 8100, RegisterType::float32),
                        reg("status", 110, RegisterType::uint16)};
  unit.map.registers[0].scale = 1e-4;
  unit.map.registers[1].role = RegisterRole::status;
  unit.map.registers[1].ok = {0};
  Gauge& gauge = make({unit}, {{"u1", "position"}});
  Result result = gauge.open();
  ASSERT_TRUE(result) << result.message;
  Reading readings[1];
  result = patiently(gauge, readings);
  ASSERT_TRUE(result) << result.message;
  EXPECT_NEAR(readings[0].value, wires_.truth(Channel::friction_force, readings[0].time_ns), 0.02);

  // A partial read is rejected, and the map needs attention.
  unit.map.registers[0] = reg("position", 8100, RegisterType::uint16);
  Gauge& half = make({unit}, {{"u1", "position"}});
  result = half.open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, HasSubstr("exception 2, illegal data address"));
  EXPECT_THAT(result.message, HasSubstr("\"position\" (holding register 8100)"));
}

TEST_P(ModbusBench, DscIsReadInPairsLowWordFirst) {
  units_.add(2, dsc_rules(),
             {sensor(at(18, Kind::f32, "CDAB"), Channel::displacement),
              sensor(at(20, Kind::f32, "CDAB"), Channel::velocity)});
  units_.start();
  config::ModbusUnit unit = settings(2);
  unit.map.registers = {reg("a", 18, RegisterType::float32), reg("b", 20, RegisterType::float32)};
  unit.map.registers[0].order = ByteOrder::cdab;
  unit.map.registers[1].order = ByteOrder::cdab;
  Gauge& gauge = make({unit}, {{"u2", "a"}, {"u2", "b"}});
  Result result = gauge.open();
  ASSERT_TRUE(result) << result.message;
  Reading readings[2];
  result = patiently(gauge, readings);
  ASSERT_TRUE(result) << result.message;
  EXPECT_NEAR(readings[0].value, wires_.truth(Channel::displacement, readings[0].time_ns), 0.02);
  EXPECT_NEAR(readings[1].value, wires_.truth(Channel::velocity, readings[1].time_ns), 0.02);
  EXPECT_LT(readings[0].time_ns, readings[1].time_ns) << "separate requests have separate times";
}

TEST_P(ModbusBench, GroupIsReadSimultaneously) {
  units_.add(1, {},
             {sensor(at(0, Kind::f64), Channel::displacement),
              sensor(at(40, Kind::f64), Channel::displacement)});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("a", 0, RegisterType::float64), reg("b", 40, RegisterType::float64)};
  for (auto& each : unit.map.registers) each.group = "g";
  Gauge& gauge = make({unit}, {{"u1", "a"}, {"u1", "b"}});
  ASSERT_TRUE(gauge.open());
  Reading readings[2];
  ASSERT_TRUE(patiently(gauge, readings));
  EXPECT_EQ(readings[0].time_ns, readings[1].time_ns);
  EXPECT_NEAR(readings[0].value, readings[1].value, 1e-3);
}

TEST_P(ModbusBench, BadStatusInvalidatesReadingsAndIsReportedOnce) {
  std::atomic<double> status{0.0};
  Parameter state = at(5, Kind::u16);
  state.number = [&status](std::int64_t) { return status.load(); };
  units_.add(1, {}, {constant(0, Kind::f32, 1.5), state});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("a", 0, RegisterType::float32), reg("status", 5, RegisterType::uint16)};
  unit.map.registers[1].role = RegisterRole::status;
  unit.map.registers[1].ok = {0, 1};
  Gauge& gauge = make({unit}, {{"u1", "a"}});
  ASSERT_TRUE(gauge.open());
  Reading readings[1];
  ASSERT_TRUE(patiently(gauge, readings));
  EXPECT_TRUE(readings[0].valid);
  status = 19.0;
  Result result;
  while ((result = gauge.read(readings)).outcome != Outcome::temporary) {
    ASSERT_NE(result.outcome, Outcome::lost);
  }
  EXPECT_THAT(result.message, HasSubstr("\"status\" (holding register 5) is 19, expected 0 or 1"));
  ASSERT_TRUE(patiently(gauge, readings));
  EXPECT_FALSE(readings[0].valid);
  status = 1.0;
  ASSERT_TRUE(patiently(gauge, readings));
  ASSERT_TRUE(patiently(gauge, readings));
  EXPECT_TRUE(readings[0].valid);
}

TEST_P(ModbusBench, AlarmIsAFaultUntilItIsReadAsOk) {
  std::atomic<double> alarm{0.0};
  Parameter state = at(5, Kind::bit, "ABCD", Table::discrete_inputs);
  state.number = [&alarm](std::int64_t) { return alarm.load(); };
  units_.add(1, {}, {state});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("tripped", 5, RegisterType::bit, RegisterTable::discrete_inputs)};
  unit.map.registers[0].role = RegisterRole::alarm;
  unit.map.registers[0].ok = {0};
  Gauge& gauge = make({unit});
  EXPECT_TRUE(gauge.inputs().empty());
  EXPECT_TRUE(gauge.signals().amplifier_fault);
  ASSERT_TRUE(gauge.open());
  ASSERT_TRUE(patiently(gauge, {}));
  EXPECT_FALSE(gauge.signals().amplifier_fault);
  alarm = 1.0;
  ASSERT_TRUE(patiently(gauge, {}));
  ASSERT_TRUE(patiently(gauge, {}));
  EXPECT_TRUE(gauge.signals().amplifier_fault);
  alarm = 0.0;
  ASSERT_TRUE(patiently(gauge, {}));
  ASSERT_TRUE(patiently(gauge, {}));
  EXPECT_FALSE(gauge.signals().amplifier_fault);
  units_.dead(1, true);
  EXPECT_EQ(patiently(gauge, {}).outcome, Outcome::lost);
  EXPECT_TRUE(gauge.signals().amplifier_fault);
}

TEST_P(ModbusBench, SettingsAreWrittenAndReadBack) {
  Parameter locked = at(20, Kind::u16);
  locked.locked = true;
  units_.add(
      1, {},
      {at(10, Kind::u16), at(12, Kind::f32), at(3, Kind::bit, "ABCD", Table::coils), locked});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("filter", 10, RegisterType::uint16),
                        reg("gain", 12, RegisterType::float32),
                        reg("relay", 3, RegisterType::bit, RegisterTable::coils)};
  unit.map.registers[0].write_single = true;
  unit.map.registers[2].write_single = true;
  const double values[] = {7.0, 3.25, 1.0};
  for (std::size_t i = 0; i < 3; ++i) {
    unit.map.registers[i].role = RegisterRole::setting;
    unit.map.registers[i].set_to = values[i];
  }
  Gauge& gauge = make({unit});
  Result result = gauge.open();
  ASSERT_TRUE(result) << result.message;
  EXPECT_EQ(units_.written(1, Table::holding, 10), 7.0);
  EXPECT_EQ(units_.written(1, Table::holding, 12), 0x4050);
  EXPECT_EQ(units_.written(1, Table::coils, 3), 1.0);

  unit.map.registers[0].address = 20;
  result = make({unit}).open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, HasSubstr("was set to 7 (7) and reads back 0"));
  unit.map.registers[0].set_to = 1e6;
  result = make({unit}).open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, HasSubstr("cannot represent 1000000"));
}

// Many units keep settings in memory limited to some ten thousand writes.
TEST_P(ModbusBench, UnchangedSettingIsNotWritten) {
  units_.add(1, {}, {at(10, Kind::u16), at(12, Kind::f32)});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("filter", 10, RegisterType::uint16),
                        reg("gain", 12, RegisterType::float32)};
  for (ModbusRegister& each : unit.map.registers) {
    each.role = RegisterRole::setting;
    each.set_to = 7.0;
  }
  Gauge& gauge = make({unit});
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(gauge.open());
    EXPECT_EQ(units_.writes(1), 2U);
  }
  // After a change by another program: only the difference.
  unit.map.registers[1].set_to = 8.0;
  ASSERT_TRUE(make({unit}).open());
  EXPECT_EQ(units_.writes(1), 3U);
  EXPECT_EQ(units_.written(1, Table::holding, 12), 0x4100);
}

TEST_P(ModbusBench, ExecutedWriteWithoutReplyIsNotRepeated) {
  units_.add(1, {}, {at(10, Kind::u16)});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("filter", 10, RegisterType::uint16)};
  unit.map.registers[0].role = RegisterRole::setting;
  unit.map.registers[0].set_to = 7.0;
  units_.next(1, LineFault::none);    // the read
  units_.next(1, LineFault::silent);  // the write
  const Result opened = make({unit}).open();
  ASSERT_TRUE(opened) << opened.message;
  EXPECT_EQ(units_.writes(1), 1U);
  EXPECT_EQ(units_.written(1, Table::holding, 10), 7.0);
}

TEST_P(ModbusBench, LockedSettingIsWrittenOnce) {
  Parameter locked = at(10, Kind::u16);
  locked.locked = true;
  units_.add(1, {}, {locked});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("filter", 10, RegisterType::uint16)};
  unit.map.registers[0].role = RegisterRole::setting;
  unit.map.registers[0].set_to = 7.0;
  Gauge& gauge = make({unit});
  for (int i = 0; i < 5; ++i) {
    const Result opened = gauge.open();
    ASSERT_EQ(opened.outcome, Outcome::needs_attention);
    EXPECT_THAT(opened.message, HasSubstr("was set to 7 (7) and reads back 0"));
    EXPECT_THAT(opened.message, HasSubstr("power-cycled"));
  }
  EXPECT_EQ(units_.writes(1), 1U);
  // After a disconnection it may have been unlocked.
  units_.dead(1, true);
  ASSERT_EQ(gauge.open().outcome, Outcome::lost);
  units_.dead(1, false);
  EXPECT_EQ(gauge.open().outcome, Outcome::needs_attention);
  EXPECT_EQ(units_.writes(1), 2U);
}

// A polled unit may reply until its time-out: on a pair of wires two replies would collide.
TEST_P(ModbusBench, AbandonedRequestKeepsASerialLineQuietUntilItsReplyIsDue) {
  units_.add(1, {}, {constant(0, Kind::u16, 1.0)});
  units_.add(2, {}, {constant(0, Kind::u16, 2.0)});
  units_.start();
  drivers::modbus::ModbusBus bus(settings(1), clock_);
  std::string why;
  ASSERT_EQ(bus.connect(why), Outcome::ok) << why;
  drivers::modbus::Caller first;
  first.timeout_ns = 120 * ms;
  drivers::modbus::Caller second;
  second.unit = 2;
  const auto request = [](int unit) {
    return drivers::modbus::read_message(unit, {RegisterTable::holding_registers, 0, 1});
  };
  units_.next(1, LineFault::late, 60 * ms);
  const std::int64_t requested_ns = clock_.now_ns();
  ASSERT_EQ(bus.exchange(first, request(1), requested_ns + 20 * ms).progress,
            drivers::modbus::Progress::waiting);
  bus.leave(first);
  const drivers::modbus::Exchange answer =
      bus.exchange(second, request(2), clock_.now_ns() + 2000 * ms);
  ASSERT_EQ(answer.progress, drivers::modbus::Progress::answered) << answer.why;
  EXPECT_EQ(answer.words, std::vector<std::uint16_t>{2});
  // Plus 3.5 characters, or that. On TCP there is no wait.
  if (!tcp()) {
    EXPECT_GE(answer.sent_ns - requested_ns, 120 * ms + 1'750'000);
  }
}

TEST_P(ModbusBench, TransientExceptionsPassAndOthersNeedAttention) {
  units_.add(1, {}, {constant(0, Kind::u16, 1.0)});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("a", 0, RegisterType::uint16)};
  Gauge& gauge = make({unit}, {{"u1", "a"}});
  Reading readings[1];
  for (const int code : {4, 5, 6, 8}) {
    ASSERT_TRUE(gauge.open());
    units_.refuse(1, static_cast<std::uint8_t>(code));
    Result result;
    for (int i = 0; i < 5; ++i) {
      while ((result = gauge.read(readings)).outcome == Outcome::no_data) {
      }
      EXPECT_EQ(result.outcome, Outcome::temporary) << code;
      EXPECT_THAT(result.message, HasSubstr("exception " + std::to_string(code)));
    }
    units_.refuse(1, 0);
    EXPECT_TRUE(patiently(gauge, readings));
  }
  for (const int code : {1, 2, 3, 10}) {
    ASSERT_TRUE(gauge.open());
    units_.refuse(1, static_cast<std::uint8_t>(code));
    EXPECT_EQ(patiently(gauge, readings).outcome, Outcome::needs_attention) << code;
    units_.refuse(1, 0);
  }
  EXPECT_GT(gauge.losses().missing, 0U);
}

TEST_P(ModbusBench, AbsentUnitIsLostWithRemedies) {
  units_.start();
  config::ModbusUnit unit = settings(9);
  unit.map.registers = {reg("a", 0, RegisterType::uint16)};
  const Result result = make({unit}, {{"u9", "a"}}).open();
  EXPECT_EQ(result.outcome, Outcome::lost);
  EXPECT_THAT(result.message, HasSubstr("unit 9 on"));
  EXPECT_THAT(result.message, HasSubstr("is its address 9"));
}

TEST_P(ModbusBench, InputMissingInTheMapNeedsAttention) {
  units_.start();
  const Result result = make({settings(1)}, {{"u1", "nonesuch"}}).open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, HasSubstr("nonesuch"));
}

TEST_P(ModbusBench, LostBusIsLostForAllUnitsAndRecovers) {
  units_.add(1, {}, {constant(0, Kind::u16, 1.0)});
  units_.add(2, {}, {constant(0, Kind::u16, 2.0)});
  units_.start();
  std::vector<config::ModbusUnit> both{settings(1), settings(2)};
  for (auto& unit : both) unit.map.registers = {reg("a", 0, RegisterType::uint16)};
  make(both, {{"u1", "a"}, {"u2", "a"}});
  ASSERT_EQ(gauges_.size(), 2U);
  Reading readings[1];
  for (auto& gauge : gauges_) {
    const Result result = patiently_opened(*gauge);
    ASSERT_TRUE(result) << result.message;
    ASSERT_TRUE(patiently(*gauge, readings));
  }
  tcp() ? units_.close_connections() : units_.unplug();
  for (auto& gauge : gauges_) {
    const Result result = patiently(*gauge, readings);
    EXPECT_EQ(result.outcome, Outcome::lost) << result.message;
    EXPECT_THAT(result.message, HasSubstr("is disconnected"));
    gauge->close();
  }
  if (!tcp()) {
    const Result result = gauges_[0]->open();
    EXPECT_EQ(result.outcome, Outcome::lost);
    EXPECT_THAT(result.message, HasSubstr("/dev/serial/by-id"));
    units_.plug_in();
  }
  for (auto& gauge : gauges_) {
    const Result result = patiently_opened(*gauge);
    ASSERT_TRUE(result) << result.message;
    ASSERT_TRUE(patiently(*gauge, readings));
  }
  EXPECT_EQ(readings[0].value, 2.0);
}

TEST_P(ModbusBench, DeadUnitDoesNotBlockOthers) {
  units_.add(1, {}, {sensor(at(0, Kind::f64), Channel::displacement)});
  units_.add(2, {}, {constant(0, Kind::u16, 2.0)});
  units_.start();
  std::vector<config::ModbusUnit> both{settings(1), settings(2)};
  both[0].map.registers = {reg("a", 0, RegisterType::float64)};
  both[1].map.registers = {reg("a", 0, RegisterType::uint16)};
  both[1].timeout_s = 0.03;
  for (auto& unit : both) unit.poll_period_s = 0.02;
  make(both, {{"u1", "a"}, {"u2", "a"}});
  for (auto& gauge : gauges_) ASSERT_TRUE(gauge->open());
  const auto readings_in_a_second = [&] {
    int got = 0;
    Reading readings[1];
    for (const std::int64_t end = clock_.now_ns() + 1000 * ms; clock_.now_ns() < end;) {
      const Result result = gauges_[0]->read(readings);
      EXPECT_NE(result.outcome, Outcome::lost) << result.message;
      if (result) ++got;
    }
    return got;
  };
  const int alone = readings_in_a_second();
  units_.dead(2, true);
  // Like GaugeReader: reopened with an increasing delay.
  std::atomic<bool> stop{false};
  std::atomic<int> losses{0};
  std::thread other([&] {
    Reading readings[1];
    std::int64_t delay = 50 * ms;
    bool open = true;
    while (!stop) {
      if (!open) {
        clock_.sleep_until(clock_.now_ns() + delay);
        delay *= 2;
        open = static_cast<bool>(gauges_[1]->open());
      } else if (gauges_[1]->read(readings).outcome == Outcome::lost) {
        gauges_[1]->close();
        open = false;
        ++losses;
      }
    }
  });
  const int beside_the_dead = readings_in_a_second();
  stop = true;
  other.join();
  EXPECT_GT(losses, 0);
  EXPECT_GT(beside_the_dead, 6 * alone / 10);
}

/// On a serial line only its time identifies a late reply: the driver waits for two time-outs,
/// which leaves 200 ms for delays of a busy host.
TEST_P(ModbusBench, LateReplyIsNotMatchedWithAnotherRequest) {
  units_.add(1, {}, {constant(0, Kind::u16, 1.0), constant(10, Kind::u16, 2.0)});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("a", 0, RegisterType::uint16), reg("b", 10, RegisterType::uint16)};
  unit.timeout_s = 0.3;
  unit.retries = 20;
  Gauge& gauge = make({unit}, {{"u1", "a"}, {"u1", "b"}});
  using Story = std::vector<std::pair<LineFault, std::int64_t>>;
  const Story stories[] = {
      // Late twice, and the next request times out.
      {{LineFault::late, 400 * ms}, {LineFault::late, 400 * ms}, {LineFault::silent, 0}},
      // Accepted as the reply to the repeated request, whose own reply arrives during the next.
      {{LineFault::late, 700 * ms}, {LineFault::late, 250 * ms}, {LineFault::silent, 0}}};
  for (const Story& story : stories) {
    ASSERT_TRUE(gauge.open());
    for (const auto& [fault, late_ns] : story) units_.next(1, fault, late_ns);
    for (int i = 0; i < 3; ++i) {
      Reading readings[2];
      ASSERT_TRUE(patiently(gauge, readings, 20.0));
      EXPECT_EQ(readings[0].value, 1.0);
      EXPECT_EQ(readings[1].value, 2.0);
    }
  }
}

TEST_P(ModbusBench, ReplyOfAnotherUnitOrTransactionIsRejected) {
  units_.add(1, {}, {constant(0, Kind::u16, 1.0)});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("a", 0, RegisterType::uint16)};
  unit.timeout_s = 0.06;
  unit.retries = 20;
  Gauge& gauge = make({unit}, {{"u1", "a"}});
  ASSERT_TRUE(gauge.open());
  for (const LineFault fault :
       {LineFault::wrong_unit, LineFault::wrong_transaction, LineFault::wrong_checksum}) {
    const std::uint64_t before = gauge.losses().rejected;
    units_.next(1, fault);
    Reading readings[1];
    ASSERT_TRUE(patiently(gauge, readings));
    EXPECT_EQ(readings[0].value, 1.0);
    EXPECT_GT(gauge.losses().rejected, before);
  }
}

/// Faults of a single reply that a line beside a power amplifier has now and then.
constexpr LineFault disturbances[] = {
    LineFault::wrong_checksum, LineFault::short_frame, LineFault::silent,
    LineFault::wrong_unit,     LineFault::extra_bytes, LineFault::wrong_transaction,
    LineFault::exception_busy, LineFault::repeated,    LineFault::torn};

/// The conditioner of the shipped bench, whose addresses are those of its map.
class ShippedBench : public ModbusBench {
 protected:
  ShippedBench() : rig_(config::load_rig(STICKSLIP_SOURCE_DIR "/config/bench-u6.toml")) {
    units_.add(
        1, orbit_rules(),
        {sensor(at(0, Kind::i32), Channel::base_displacement, 1e-4), constant(2, Kind::u16, 0)});
    units_.start();
    config::ModbusUnit unit = rig_.bench.modbus.front();
    unit.transport = GetParam();
    unit.port = tcp() ? units_.tcp_port() : units_.serial_port();
    gauge_ = &make({unit}, {{unit.name, "position"}});
  }

  /// The greatest age [s] that the latest reading reaches after the next reply.
  double oldest() {
    Reading readings[1];
    std::int64_t measured_ns = clock_.now_ns();
    std::int64_t oldest_ns = 0;
    for (const std::int64_t end = measured_ns + 350 * ms; clock_.now_ns() < end;) {
      const Result result = gauge_->read(readings);
      EXPECT_NE(result.outcome, Outcome::lost) << result.message;
      EXPECT_NE(result.outcome, Outcome::needs_attention) << result.message;
      if (!result || !readings[0].valid) continue;
      oldest_ns = std::max(oldest_ns, clock_.now_ns() - measured_ns);
      measured_ns = readings[0].time_ns;
    }
    oldest_ns = std::max(oldest_ns, clock_.now_ns() - measured_ns);
    return static_cast<double>(oldest_ns) * 1e-9;
  }

  config::Rig rig_;
  Gauge* gauge_ = nullptr;
};

INSTANTIATE_TEST_SUITE_P(Lines, ShippedBench,
                         testing::Values(ModbusTransport::rtu, ModbusTransport::tcp),
                         [](const auto& info) {
                           return info.param == ModbusTransport::rtu ? "Rtu" : "Tcp";
                         });

// A busy host only adds to the age, so one of several attempts has to stay below the limit.
TEST_P(ShippedBench, OneDisturbedReplyDoesNotMakeAChannelStale) {
  ASSERT_TRUE(gauge_->open());
  for (const LineFault fault : disturbances) {
    SCOPED_TRACE(static_cast<int>(fault));
    for (const bool of_status : {false, true}) {
      double least_s = std::numeric_limits<double>::max();
      for (int attempt = 0; attempt < 8 && least_s >= rig_.safety.stale_after_s; ++attempt) {
        if (of_status) units_.next(1, LineFault::none);
        units_.next(1, fault);
        least_s = std::min(least_s, oldest());
      }
      EXPECT_LT(least_s, rig_.safety.stale_after_s);
    }
  }
}

// An invalid reply has arrived: the time-out need not be awaited.
TEST_P(ModbusBench, InvalidReplyIsRequestedAgainAtOnce) {
  units_.add(1, {}, {constant(0, Kind::u16, 1.0)});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("a", 0, RegisterType::uint16)};
  unit.timeout_s = 10.0;
  Gauge& gauge = make({unit}, {{"u1", "a"}});
  ASSERT_TRUE(gauge.open());
  Reading readings[1];
  for (const LineFault fault :
       {LineFault::wrong_checksum, LineFault::short_frame, LineFault::wrong_unit}) {
    SCOPED_TRACE(static_cast<int>(fault));
    if (tcp() && fault != LineFault::wrong_unit) continue;  // its reply is awaited completely
    units_.next(1, fault);
    const std::int64_t before_ns = clock_.now_ns();
    ASSERT_TRUE(patiently(gauge, readings, 10.0));
    ASSERT_TRUE(patiently(gauge, readings, 10.0));
    EXPECT_LT(clock_.now_ns() - before_ns, 5000 * ms);
    EXPECT_EQ(readings[0].value, 1.0);
  }
}

TEST_P(ModbusBench, LateReplyOfAnotherUnitIsNotTakenForADisturbedOne) {
  units_.add(1, {}, {constant(0, Kind::u16, 1.0)});
  units_.add(2, {}, {constant(0, Kind::u16, 2.0)});
  units_.start();
  drivers::modbus::ModbusBus bus(settings(1), clock_);
  std::string why;
  ASSERT_EQ(bus.connect(why), Outcome::ok) << why;
  drivers::modbus::Caller first;
  first.timeout_ns = 60 * ms;
  drivers::modbus::Caller second;
  second.unit = 2;
  second.timeout_ns = 2000 * ms;
  const auto request = [](int unit) {
    return drivers::modbus::read_message(unit, {RegisterTable::holding_registers, 0, 1});
  };
  units_.next(1, LineFault::late, 80 * ms);
  units_.next(2, LineFault::late, 400 * ms);
  ASSERT_EQ(bus.exchange(first, request(1), clock_.now_ns() + 2000 * ms).progress,
            drivers::modbus::Progress::silent);
  const auto answer = bus.exchange(second, request(2), clock_.now_ns() + 2000 * ms);
  ASSERT_EQ(answer.progress, drivers::modbus::Progress::answered) << answer.why;
  EXPECT_EQ(answer.words, std::vector<std::uint16_t>{2});
}

TEST_P(ModbusBench, AlarmUnreadForLongIsAFault) {
  units_.add(1, {}, {constant(5, Kind::u16, 0.0)});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("tripped", 5, RegisterType::uint16)};
  unit.map.registers[0].role = RegisterRole::alarm;
  unit.map.registers[0].ok = {0};
  Gauge& gauge = make({unit});
  ASSERT_TRUE(gauge.open());
  ASSERT_TRUE(patiently(gauge, {}));
  EXPECT_FALSE(gauge.signals().amplifier_fault);
  units_.refuse(1, 6);
  EXPECT_EQ(patiently(gauge, {}, 0.5).outcome, Outcome::temporary);
  EXPECT_TRUE(gauge.signals().amplifier_fault);
  units_.refuse(1, 0);
  ASSERT_TRUE(patiently(gauge, {}));
  EXPECT_FALSE(gauge.signals().amplifier_fault);
  gauge.close();
  EXPECT_TRUE(gauge.signals().amplifier_fault);
}

TEST_P(ModbusBench, ConfiguredPausesAreKept) {
  units_.add(1, {}, {constant(0, Kind::u16, 1.0), constant(1, Kind::u16, 2.0)});
  units_.start();
  config::ModbusUnit unit = settings(1);
  unit.map.registers = {reg("a", 0, RegisterType::uint16), reg("b", 1, RegisterType::uint16)};
  unit.pause_after_connect_s = 0.1;
  unit.pause_between_requests_s = 0.2;  // longer than a read waits
  Gauge& gauge = make({unit}, {{"u1", "a"}, {"u1", "b"}});
  const std::int64_t before = clock_.now_ns();
  ASSERT_TRUE(gauge.open());
  EXPECT_GE(clock_.now_ns() - before, 300 * ms);
  Reading readings[2];
  ASSERT_TRUE(patiently(gauge, readings));
  EXPECT_GE(readings[1].time_ns - readings[0].time_ns, 195 * ms);
}

/// Two units with every channel, and a line with every fault, for a fixed time.
class FaultyLine : public ModbusBench {
 protected:
  void set_up() {
    for (const std::uint32_t unit : {1U, 2U}) {
      std::vector<Parameter> parameters;
      for (const Channel channel : all_channels) {
        const int i = static_cast<int>(index_of(channel));
        parameters.push_back(sensor(at(10 * i, Kind::f64, "CDAB"), channel));
      }
      units_.add(static_cast<int>(unit), {}, parameters);
    }
    units_.start();
    std::vector<config::ModbusUnit> both{settings(1), settings(2)};
    for (auto& unit : both) {
      for (const Channel channel : all_channels) {
        const auto i = index_of(channel);
        unit.map.registers.push_back(reg(std::string(1, 'c').append(std::to_string(i)),
                                         10 * static_cast<int>(i), RegisterType::float64));
        unit.map.registers.back().order = ByteOrder::cdab;
      }
      unit.timeout_s = 0.02;
      unit.retries = 3;
      unit.poll_period_s = 0.002;
    }
    // Channels 0, 2 and 4 from one unit, the others from the other: replies of equal length and
    // form.
    make(both, {{"u1", "c0"}, {"u2", "c1"}, {"u1", "c2"}, {"u2", "c3"}, {"u1", "c4"}});
    const Weather weather{
        0.15,
        {LineFault::late, LineFault::silent, LineFault::wrong_checksum, LineFault::wrong_unit,
         LineFault::wrong_transaction, LineFault::short_frame, LineFault::extra_bytes,
         LineFault::exception_busy, LineFault::repeated, LineFault::torn, LineFault::closed},
        28 * ms};
    for (const int unit : {1, 2}) units_.weather(unit, weather);
  }

  /// Reads a gauge until `end_ns`, reopening it after losses, and compares its readings with the
  /// truth.
  void read_until(std::int64_t end_ns, Gauge& gauge, std::vector<std::size_t> channels) {
    std::vector<Reading> readings(channels.size());
    bool open = false;
    while (clock_.now_ns() < end_ns) {
      if (!open) {
        open = static_cast<bool>(gauge.open());
        if (!open) clock_.sleep_until(clock_.now_ns() + 5 * ms);
        continue;
      }
      const std::int64_t before = clock_.now_ns();
      const Result result = gauge.read(readings);
      EXPECT_LT(clock_.now_ns() - before, 1000 * ms) << "it hangs";
      if (result.outcome == Outcome::lost || result.outcome == Outcome::needs_attention) {
        rejected_ += gauge.losses().rejected;
        gauge.close();
        open = false;
      }
      if (!result) continue;
      for (std::size_t i = 0; i < channels.size(); ++i) {
        const double truth = wires_.truth(all_channels[channels[i]], readings[i].time_ns);
        // The delay of up to two time-outs is documented for the driver.
        const bool good = readings[i].valid && std::abs(readings[i].value - truth) < 0.08;
        ++(good ? right_ : wrong_);
        EXPECT_TRUE(good) << channels[i] << ": " << readings[i].value << " and not " << truth;
      }
    }
  }

  std::atomic<std::uint64_t> right_{0};
  std::atomic<std::uint64_t> wrong_{0};
  std::atomic<std::uint64_t> rejected_{0};  // over all openings
};

INSTANTIATE_TEST_SUITE_P(Lines, FaultyLine,
                         testing::Values(ModbusTransport::rtu, ModbusTransport::tcp),
                         [](const auto& info) {
                           return info.param == ModbusTransport::rtu ? "Rtu" : "Tcp";
                         });

/// Every fault of a reply, many times.
TEST_P(FaultyLine, NoFaultYieldsAWrongValue) {
  set_up();
  const std::int64_t end = clock_.now_ns() + 3000 * ms;
  std::thread other([&] { read_until(end, *gauges_[1], {1, 3}); });
  read_until(end, *gauges_[0], {0, 2, 4});
  other.join();
  rejected_ += gauges_[0]->losses().rejected + gauges_[1]->losses().rejected;
  EXPECT_EQ(wrong_, 0U);
  EXPECT_GT(right_, 50U);
  EXPECT_GT(units_.faults(), 20U);
  EXPECT_GT(rejected_, 5U);
  EXPECT_EQ(units_.nonsense(), 0U) << "the driver sends valid requests only";
  RecordProperty("right", static_cast<int>(right_));
  RecordProperty("faults", static_cast<int>(units_.faults()));
  std::printf("%llu right, %llu faults, %llu rejected\n", static_cast<unsigned long long>(right_),
              static_cast<unsigned long long>(units_.faults()),
              static_cast<unsigned long long>(rejected_));
}

}  // namespace
}  // namespace stickslip::emulated
