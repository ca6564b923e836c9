// SPDX-License-Identifier: Apache-2.0
// The acceptance of a bench whose amplifier is on the lines of an emulated GPIO chip with a
// watchdog relay, and whose force is that of an emulated Modbus unit on a serial line; the board is
// an emulated USB-1208FS-Plus. A sound bench passes every step, and each fault is found by the step
// that is for it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/clock/host_clock.h"
#include "tests/emulated/attach/emulated_bus.h"
#include "tests/emulated/attach/emulated_libusb.h"
#include "tests/emulated/commissioning/acceptance.h"
#include "tests/emulated/gpio/emulated_contact.h"
#include "tests/emulated/gpio/emulated_gpio.h"
#include "tests/emulated/modbus/emulated_modbus_units.h"
#include "tests/emulated/usb_1208fs_plus/emulated_usb_1208fs_plus.h"

namespace stickslip::emulated {
namespace {

using commissioning::StepRecord;
using commissioning::Verdict;
using testing::HasSubstr;

constexpr const char* chip = "/dev/gpiochip3";
constexpr unsigned enable_line = 0;
constexpr unsigned heartbeat_line = 1;
constexpr unsigned stop_line = 2;
constexpr unsigned fault_line = 3;
constexpr double volts_per_metre = 500.0;
constexpr int unit_number = 5;
constexpr double newton_per_count = 1e-3;

/// A normally closed contact to the supply, pulled down: low if pressed, or if its wire is cut.
config::GpioLine normally_closed(const char* line) {
  return {.line = line, .active_low = true, .bias = config::GpioLine::Bias::pull_down};
}

config::ModbusRegister register_at(const char* name, int address, config::RegisterRole role) {
  config::ModbusRegister out;
  out.name = name;
  out.address = address;
  out.role = role;
  out.type = role == config::RegisterRole::reading ? config::RegisterType::int32
                                                   : config::RegisterType::uint16;
  out.ok = {0};
  return out;
}

Parameter at(int address, Kind kind) {
  Parameter out;
  out.address = address;
  out.kind = kind;
  return out;
}

config::ModbusUnit unit_at(const std::string& port) {
  config::ModbusUnit out;
  out.name = "conditioner";
  out.unit = unit_number;
  out.port = port;
  out.baud = 115200;
  // Test hosts are busy.
  out.timeout_s = 0.25;
  out.retries = 8;
  out.poll_period_s = 0.005;
  out.map.name = "test unit";
  out.map.registers = {register_at("force", 0, config::RegisterRole::reading),
                       register_at("state", 4, config::RegisterRole::status),
                       register_at("trip", 5, config::RegisterRole::alarm)};
  return out;
}

config::Rig rig_of_test(const std::string& port) {
  config::Rig rig;
  rig.name = "bench";
  rig.driver = config::DriverKind::bench;
  rig.loop.rate_hz = 1000.0;
  rig.limits.displacement_m = 0.015;
  rig.excitation.carrier_hz = 5.0;
  rig.safety.stale_after_s = 5.0;
  rig.safety.longest_overrun_s = 5.0;
  rig.model.oscillator.excitation = physics::Excitation::base;
  config::Bench& bench = rig.bench;
  bench.board = config::BoardKind::usb_1208fs_plus;
  bench.inputs[index_of(Channel::displacement)] = {"usb_1208fs_plus", "CH0", 10.0, false, 1};
  bench.inputs[index_of(Channel::velocity)] = {"usb_1208fs_plus", "CH1", 10.0, false, 1};
  bench.inputs[index_of(Channel::base_displacement)] = {"usb_1208fs_plus", "CH2", 10.0, false, 1};
  bench.inputs[index_of(Channel::friction_force)] = {"conditioner", "force", 10.0, false, 1};
  bench.shaker.volts_per_unit = 150.0;
  bench.modbus = {unit_at(port)};
  bench.amplifier.emplace().chip = chip;
  bench.amplifier->enable = config::GpioLine{.line = "enable"};
  bench.amplifier->heartbeat = config::GpioLine{.line = "beat"};
  bench.amplifier->emergency_stop = normally_closed("stop");
  bench.amplifier->fault = normally_closed("fault");
  bench.readback.drive.emplace().input = {"usb_1208fs_plus", "CH6", 10.0, false, 1};
  bench.readback.enable.emplace().input = {"usb_1208fs_plus", "CH7", 10.0, false, 1};
  rig.calibration[index_of(Channel::displacement)].gain = 1.0 / volts_per_metre;
  rig.calibration[index_of(Channel::velocity)].gain = 0.1;
  rig.calibration[index_of(Channel::base_displacement)].gain = 1.0 / volts_per_metre;
  rig.calibration[index_of(Channel::friction_force)].gain = newton_per_count;
  return rig;
}

struct AcceptanceOfLines : Acceptance {
  AcceptanceOfLines() {
    emulated_gpio().clear();
    plug_chip();
    bus.plug(board, 1);
    units.add(unit_number, {}, parameters());
    units.start();
    rig = rig_of_test(units.serial_port());
    const std::vector<Action> more = {
        {"pull its wire out", [this] { put(hands_on_fault ? fault_line : stop_line, false); }, ""},
        {"put the wire back", [this] { put(hands_on_fault ? fault_line : stop_line, true); }, ""},
        {"unplug usb_1208fs_plus", [this] { unplug_board(); }, ""},
        {"plug usb_1208fs_plus in", [this] { bus.plug(board, 1); }, ""},
        {"unplug conditioner", [this] { units.unplug(); }, ""},
        {"plug conditioner in", [this] { units.plug_in(); }, ""},
        {"unplug GPIO chip", [] { emulated_gpio().unplug(chip); }, ""},
        {"plug GPIO chip", [this] { plug_chip(); }, ""},
    };
    actions.insert(actions.end(), more.begin(), more.end());
    on("press the emergency stop").act = [this] { put(stop_line, false); };
    on("release the button").act = [this] { put(stop_line, true); };
    on("make the amplifier report").act = [this] { put(fault_line, false); };
    on("end the amplifier's fault").act = [this] { put(fault_line, true); };
  }
  ~AcceptanceOfLines() override {
    EXPECT_FALSE(contact.closed());
    EXPECT_THAT(bus.misuses(), testing::IsEmpty());
    std::filesystem::remove_all(folder);
  }

  void put(unsigned line, bool high) { emulated_gpio().put(chip, line, high); }
  void plug_chip() {
    emulated_gpio().add_chip(chip, "cp2112_gpio", {"enable", "beat", "stop", "fault"});
    put(stop_line, true);
    put(fault_line, true);
  }
  /// Acts once the contact has closed. Not in a callback of the board, which holds its bus.
  std::jthread once_on(std::function<void()> act) {
    return std::jthread([this, act = std::move(act)](const std::stop_token& ended) {
      while (!ended.stop_requested() && !contact.closed()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
      if (ended.stop_requested()) return;
      was_on = true;
      act();
    });
  }
  void unplug_board() {
    bus.between_calls([this] { board.unplug(); });
    bus.unplug(board);
  }

  EmulatedUsb1208fsPlus::Options board_options() {
    EmulatedUsb1208fsPlus::Options out;
    out.sensors[0] = Sensor{Channel::displacement, volts_per_metre, 0.0};
    out.sensors[1] = Sensor{Channel::velocity, 10.0, 0.0};
    out.sensors[2] = Sensor{Channel::base_displacement, volts_per_metre, 0.0};
    out.output_terminal = 6;
    out.contact_terminal = 7;
    out.contact_closed = [this] {
      const bool closed = contact.closed();
      hands.enable(closed, 0);
      return closed;
    };
    return out;
  }
  std::vector<Parameter> parameters() {
    Parameter force = measured(at(0, Kind::i32),
                               Sensor{Channel::friction_force, 1.0 / newton_per_count, 0.0}, hands);
    // The last digits of a real conditioner are noise.
    force.number = [number = force.number, this](std::int64_t time_ns) {
      return scale * number(time_ns) + static_cast<double>(time_ns / 1'000'000 % 3 - 1);
    };
    Parameter state = at(4, Kind::u16);
    state.number = [this](std::int64_t) { return static_cast<double>(unit_state); };
    Parameter trip = at(5, Kind::u16);
    trip.number = [this](std::int64_t) { return static_cast<double>(unit_trip); };
    return {force, state, trip};
  }

  drivers::MonotonicHostClock clock;
  std::filesystem::path folder = std::filesystem::temp_directory_path() /
                                 ("stickslip-acceptance-" + std::to_string(::getpid()));
  std::atomic<bool> was_on = false;  // seen by once_on
  std::atomic<double> scale = 1.0;
  std::atomic<int> unit_state = 0;
  std::atomic<int> unit_trip = 0;
  EmulatedContact contact{
      {.chip = chip, .enable = enable_line, .heartbeat = heartbeat_line, .hold_ns = 1'000'000'000},
      [this] { return clock.now_ns(); }};
  EmulatedBus bus;
  EmulatedUsb1208fsPlus board{board_options(), hands, [this] { return clock.now_ns(); }};
  EmulatedModbusUnits units{[this] { return clock.now_ns(); }, folder, 1};
};

// The converter of the board is coarse: at rest every reading of an input is the same.
TEST_F(AcceptanceOfLines, SoundBenchPassesEveryStep) {
  EXPECT_TRUE(accept()) << shown;
  for (const commissioning::Step& step : commissioning::all_steps()) {
    const StepRecord* found = record.find(step.id);
    ASSERT_NE(found, nullptr) << step.id;
    const bool no_bridge = step.id == std::string("shunt");
    EXPECT_EQ(found->verdict, no_bridge ? Verdict::not_applicable : Verdict::passed)
        << step.id << ": " << found->text;
  }
  EXPECT_THAT(record.devices,
              testing::AllOf(HasSubstr("USB-1208FS-Plus"), HasSubstr("conditioner")));
  const auto number = [this](const char* step, const char* name) {
    return measured_of(*record.find(step), name).value_or(commissioning::Measured{}).value;
  };
  EXPECT_NEAR(number("noise", "displacement.noise_raw"), 10.0 / 1024.0 / std::sqrt(12.0), 1e-4);
  EXPECT_THAT(record.find("watchdog")->text, HasSubstr("by the watchdog relay"));
  EXPECT_GT(number("watchdog", "watchdog.time"), 0.5);
  EXPECT_NEAR(number("drive", "drive.readback"), 0.0225, 0.004);
  EXPECT_NEAR(number("delays", "friction_force.delay_s"), 0.0, 0.02);
  for (const char* plug :
       {"usb_1208fs_plus.loss", "conditioner.loss", "GPIO chip /dev/gpiochip3.loss"}) {
    EXPECT_TRUE(measured_of(*record.find("plugs"), plug)) << plug;
  }
}

// Identities and noise

TEST_F(AcceptanceOfLines, MissingChipIsFoundByTheIdentities) {
  emulated_gpio().unplug(chip);
  expect_failed("identities", "/dev/gpiochip3 cannot be opened");
  plug_chip();
}

TEST_F(AcceptanceOfLines, LineOfAnotherProgramIsFoundByTheIdentities) {
  emulated_gpio().occupy(chip, enable_line, "sysfs");
  expect_failed("identities", "is used by \"sysfs\"");
}

TEST_F(AcceptanceOfLines, UnpluggedLineOfTheUnitIsFoundByTheIdentities) {
  units.unplug();
  expect_failed("identities", "conditioner");
}

TEST_F(AcceptanceOfLines, UnitThatRefusesIsFoundByTheIdentities) {
  units.refuse(unit_number, 2);
  expect_failed("identities", "exception 2");
}

TEST_F(AcceptanceOfLines, UnitThatReportsAnErrorIsFoundByTheNoise) {
  unit_state = 7;
  expect_failed("noise", "There is no valid reading of friction_force from conditioner/force");
}

// Its relay closes with the heartbeat, and the amplifier is on whenever it was commanded off.
TEST_F(AcceptanceOfLines, WrongPolarityOfTheEnableLineIsFoundByTheNoise) {
  rig.bench.amplifier->enable->active_low = true;
  expect_failed("noise", "enable contact is closed although it was not commanded");
  contact.cut();
}

// Polarity and delays

TEST_F(AcceptanceOfLines, ReversedConditionerIsFoundByThePolarity) {
  scale = -1.0;
  expect_failed("polarity", "friction_force fell");
}

TEST_F(AcceptanceOfLines, WrongRegisterIsFoundByThePolarity) {
  durations.response_s = 1.5;
  scale = 0.0;
  expect_failed("polarity", "friction_force did not respond");
}

TEST_F(AcceptanceOfLines, SlowFilterOfTheConditionerIsFoundByTheDelays) {
  hands.late_s[index_of(Channel::friction_force)] = 0.06;
  expect_failed("delays", "A model takes up to 30 ms");
  const auto late = measured_of(*record.find("delays"), "friction_force.delay_s");
  ASSERT_TRUE(late);
  EXPECT_NEAR(late->value, 0.06, 0.02);
}

// Half of the time of an exchange is unknown: replies that are late show in the uncertainty.
TEST_F(AcceptanceOfLines, LateRepliesOfTheUnitShowInTheUncertaintyOfItsDelay) {
  units.weather(unit_number,
                {.probability = 1.0, .faults = {LineFault::late}, .late_ns = 10'000'000});
  static_cast<void>(made("delays"));
  const auto late = measured_of(*record.find("delays"), "friction_force.delay_s");
  ASSERT_TRUE(late) << record.find("delays")->text;
  EXPECT_GT(late->sigma.value_or(0.0), 0.002);
}

// Emergency stop and fault line

TEST_F(AcceptanceOfLines, ButtonWithoutItsWireIsFoundByTheEmergencyStop) {
  durations.response_s = 1.0;
  on("press the emergency stop").act = {};
  expect_failed("emergency_stop", "did not react: press the emergency stop");
}

TEST_F(AcceptanceOfLines, NormallyOpenContactIsFoundByThePulledWire) {
  durations.response_s = 1.0;
  rig.bench.amplifier->emergency_stop->active_low = false;
  put(stop_line, false);
  on("press the emergency stop").act = [this] { put(stop_line, true); };
  on("release the button").act = [this] { put(stop_line, false); };
  on("pull its wire out").act = [this] { put(stop_line, false); };
  on("put the wire back").act = {};
  expect_failed("emergency_stop", "did not react: pull its wire out");
}

TEST_F(AcceptanceOfLines, WrongPolarityOfTheStopIsFoundBeforeAnythingIsDone) {
  durations.response_s = 1.0;
  rig.bench.amplifier->emergency_stop->active_low = false;
  expect_failed("emergency_stop", "although nothing was done");
}

TEST_F(AcceptanceOfLines, FaultThatDoesNotArriveIsFoundByTheFaultLine) {
  durations.response_s = 1.0;
  on("make the amplifier report").act = {};
  expect_failed("amplifier_fault", "did not react");
}

TEST_F(AcceptanceOfLines, LongDebouncingIsFoundByTheFaultLine) {
  durations.response_s = 1.0;
  rig.bench.amplifier->fault->debounce_s = 10.0;
  expect_failed("amplifier_fault", "although nothing was done");
}

// An alarm of the unit is a fault of the amplifier, and its cable the wire.
TEST_F(AcceptanceOfLines, AlarmOfTheUnitIsTestedLikeALine) {
  rig.bench.amplifier->fault.reset();
  on("make the amplifier report").act = [this] { unit_trip = 1; };
  on("end the amplifier's fault").act = [this] { unit_trip = 0; };
  on("pull its wire out").act = [this] { units.unplug(); };
  on("put the wire back").act = [this] { units.plug_in(); };
  const StepRecord found = made("amplifier_fault");
  EXPECT_EQ(found.verdict, Verdict::passed) << found.text;
  durations.response_s = 1.0;
  on("make the amplifier report").act = {};
  expect_failed("amplifier_fault", "did not react: make the amplifier report");
}

TEST_F(AcceptanceOfLines, NothingThatReportsFaultsDoesNotApply) {
  rig.bench.amplifier->fault.reset();
  rig.bench.modbus[0].map.registers.pop_back();
  EXPECT_EQ(made("amplifier_fault").verdict, Verdict::not_applicable);
}

// Plugs

// It is the source of no channel, but its alarm is read.
TEST_F(AcceptanceOfLines, UnitWithAnAlarmOnlyHasAPlug) {
  rig.bench.inputs[index_of(Channel::friction_force)].reset();
  const StepRecord found = made("plugs");
  EXPECT_EQ(found.verdict, Verdict::passed) << found.text;
  EXPECT_TRUE(measured_of(found, "conditioner.loss"));
}

// A chip may drive its lines although no one can command it: that comes first.
TEST_F(AcceptanceOfLines, ChipThatDoesNotComeBackMayHaveLeftTheAmplifierOn) {
  durations.return_s = 2.0;
  on("plug GPIO chip").act = {};
  expect_failed("plugs", "The amplifier may still be on");
  plug_chip();
}

TEST_F(AcceptanceOfLines, UnitThatDoesNotComeBackIsFoundByThePlugs) {
  durations.return_s = 2.0;
  on("plug conditioner in").act = {};
  expect_failed("plugs", "conditioner did not come back");
}

TEST_F(AcceptanceOfLines, UnitWithoutAPlugOfItsOwnIsFoundByThePlugs) {
  durations.response_s = 1.0;
  on("unplug conditioner").act = {};
  on("plug conditioner in").act = {};
  expect_failed("plugs", "The loss of conditioner was not noticed");
}

TEST_F(AcceptanceOfLines, SilentUnitIsNoticedByThePlugs) {
  on("unplug conditioner").act = [this] { units.dead(unit_number, true); };
  on("plug conditioner in").act = [this] { units.dead(unit_number, false); };
  const StepRecord found = made("plugs");
  EXPECT_EQ(found.verdict, Verdict::passed) << found.text;
  EXPECT_TRUE(measured_of(found, "conditioner.loss"));
}

// Times

TEST_F(AcceptanceOfLines, UnitThatIsTooSlowIsFoundByTheTimes) {
  rig.bench.modbus[0].poll_period_s = 0.2;
  rig.safety.stale_after_s = 0.05;
  expect_failed("timing", "friction_force was up to");
}

// Watchdog relay

TEST_F(AcceptanceOfLines, RelayWithoutAHeartbeatsEffectIsFoundByTheWatchdog) {
  contact.set_relay_held(true);
  expect_failed("watchdog", "stayed closed");
  EXPECT_THAT(record.find("watchdog")->remedy, HasSubstr("watchdog relay"));
}

TEST_F(AcceptanceOfLines, CutEnableWireIsFoundByTheWatchdog) {
  contact.cut();
  expect_failed("watchdog", "did not close");
}

TEST_F(AcceptanceOfLines, PersonIsAskedWhereNothingReadsTheContact) {
  rig.bench.readback.enable.reset();
  actions.push_back({"did the amplifier switch off by itself", {}, "n"});
  expect_failed("watchdog", "not switched off by any device");
  on("did the amplifier switch off by itself").answer = "y";
  EXPECT_EQ(made("watchdog").verdict, Verdict::passed);
}

// Drive

TEST_F(AcceptanceOfLines, StuckOutputIsFoundByTheDrive) {
  bus.between_calls([this] { board.set_outputs_stuck(true); });
  expect_failed("drive", "The output reads back with");
}

TEST_F(AcceptanceOfLines, ReversedShakerIsFoundByTheDrive) {
  rig.bench.shaker.volts_per_unit = -150.0;
  expect_failed("drive", "It moves the other way");
}

TEST_F(AcceptanceOfLines, FaultLineEndsTheDrive) {
  const std::jthread watcher = once_on([this] { put(fault_line, false); });
  expect_failed("drive", "The drive was stopped: the amplifier reports a fault");
}

TEST_F(AcceptanceOfLines, AlarmOfTheUnitEndsTheDrive) {
  const std::jthread watcher = once_on([this] { unit_trip = 1; });
  expect_failed("drive", "The drive was stopped: the amplifier reports a fault");
}

TEST_F(AcceptanceOfLines, LostUnitEndsTheDrive) {
  const std::jthread watcher = once_on([this] { units.unplug(); });
  expect_failed("drive", "The drive was stopped: ");
  EXPECT_THAT(record.find("drive")->text, HasSubstr("conditioner"));
}

TEST_F(AcceptanceOfLines, LostChipEndsTheDrive) {
  const std::jthread watcher = once_on([] { emulated_gpio().unplug(chip); });
  const StepRecord found = made("drive");
  EXPECT_EQ(found.verdict, Verdict::failed) << found.text;
  EXPECT_TRUE(was_on);
  EXPECT_FALSE(contact.closed());
  plug_chip();
}

}  // namespace
}  // namespace stickslip::emulated
