// SPDX-License-Identifier: Apache-2.0
// The acceptance of a bench of an emulated LabJack U6 and an emulated PhidgetBridge: a sound one
// passes every step, and each fault is found by the step that is for it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "diagnosis/shooting.h"
#include "drivers/clock/host_clock.h"
#include "tests/emulated/attach/emulated_bus.h"
#include "tests/emulated/attach/emulated_hidapi.h"
#include "tests/emulated/attach/emulated_libusb.h"
#include "tests/emulated/commissioning/acceptance.h"
#include "tests/emulated/labjack_u6/emulated_labjack_u6.h"
#include "tests/emulated/phidget_bridge/emulated_phidget_bridge.h"

namespace stickslip::emulated {
namespace {

using commissioning::StepRecord;
using commissioning::Verdict;
using testing::HasSubstr;

constexpr double volts_per_metre = 500.0;
constexpr double ratio_per_newton = 2e-4;
constexpr double shunt_ohm = 100e3;
constexpr double bridge_ohm = 350.0;

config::Rig rig_of_test() {
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
  bench.inputs[index_of(Channel::displacement)] = {"labjack_u6", "AIN0", 10.0, false, 1};
  bench.inputs[index_of(Channel::velocity)] = {"labjack_u6", "AIN1", 10.0, false, 1};
  bench.inputs[index_of(Channel::base_displacement)] = {"labjack_u6", "AIN2", 10.0, false, 1};
  bench.inputs[index_of(Channel::friction_force)] = {"phidget_bridge", "0", 10.0, false, 128};
  bench.labjack_u6.enable_line = 0;
  bench.labjack_u6.amplifier_fault_line = 1;
  bench.labjack_u6.emergency_stop_line = 2;
  bench.labjack_u6.watchdog_s = 1;
  bench.shaker.volts_per_unit = 150.0;
  bench.readback.drive.emplace().input = {"labjack_u6", "AIN12", 10.0, false, 1};
  bench.readback.enable.emplace().input = {"labjack_u6", "AIN13", 10.0, false, 1};
  rig.calibration[index_of(Channel::displacement)].gain = 1.0 / volts_per_metre;
  rig.calibration[index_of(Channel::velocity)].gain = 0.1;
  rig.calibration[index_of(Channel::base_displacement)].gain = 1.0 / volts_per_metre;
  rig.calibration[index_of(Channel::friction_force)].gain = 1.0 / ratio_per_newton;
  return rig;
}

LabjackU6Options board_options() {
  LabjackU6Options out;
  out.enable_line = 0;
  out.amplifier_fault_line = 1;
  out.emergency_stop_line = 2;
  out.drive_input = 12;
  out.enable_input = 13;
  return out;
}

EmulatedPhidgetBridge::Options bridge_options() {
  EmulatedPhidgetBridge::Options out;
  out.sensors[0] = Sensor{Channel::friction_force, ratio_per_newton, 0.0};
  out.noise_v_per_v = 2e-8;
  return out;
}

struct AcceptanceOfABench : Acceptance {
  AcceptanceOfABench() {
    rig = rig_of_test();
    board.wire(0, {Channel::displacement, volts_per_metre, 0.0});
    board.wire(1, {Channel::velocity, 10.0, 0.0});
    board.wire(2, {Channel::base_displacement, volts_per_metre, 0.0});
    bus.plug(board, 1);
    bus.plug(bridge, 2);
    const double shunt_n = bridge_ohm / (4 * shunt_ohm + 2 * bridge_ohm) / ratio_per_newton;
    const std::vector<Action> more = {
        {"as in \"100000 350\"", {}, "100000 350"},
        {"connect the shunt", push(Channel::friction_force, shunt_n), ""},
        {"remove the shunt", push(Channel::friction_force, 0.0), ""},
        {"pull its wire out", [this] { (hands_on_fault ? hands.fault : hands.pressed) = true; },
         ""},
        {"put the wire back", [this] { (hands_on_fault ? hands.fault : hands.pressed) = false; },
         ""},
        {"unplug labjack_u6", [this] { bus.unplug(board); }, ""},
        {"plug labjack_u6 in", [this] { bus.plug(board, 1); }, ""},
        {"unplug phidget_bridge", [this] { bus.unplug(bridge); }, ""},
        {"plug phidget_bridge in", [this] { bus.plug(bridge, 2); }, ""},
    };
    actions.insert(actions.end(), more.begin(), more.end());
  }
  ~AcceptanceOfABench() override {
    EXPECT_FALSE(hands.is_on());
    EXPECT_THAT(bus.misuses(), testing::IsEmpty());
  }

  drivers::MonotonicHostClock clock;
  EmulatedBus bus;
  EmulatedLabjackU6 board{hands, [this] { return clock.now_ns(); }, board_options()};
  EmulatedPhidgetBridge bridge{bridge_options(), hands, [this] { return clock.now_ns(); }};
  std::atomic<bool> contact_closed = false;
};

TEST_F(AcceptanceOfABench, SoundBenchPassesEveryStep) {
  EXPECT_TRUE(accept()) << shown;
  for (const commissioning::Step& step : commissioning::all_steps()) {
    const StepRecord* found = record.find(step.id);
    ASSERT_NE(found, nullptr) << step.id;
    EXPECT_EQ(found->verdict, Verdict::passed) << step.id << ": " << found->text;
  }
  EXPECT_THAT(record.devices, testing::AllOf(HasSubstr("LabJack U6"), HasSubstr("PhidgetBridge")));
  const auto number = [this](const char* step, const char* name) {
    return measured_of(*record.find(step), name).value_or(commissioning::Measured{}).value;
  };
  EXPECT_NEAR(number("shunt", "friction_force.shunt_ratio"), 1.0, 0.01);
  EXPECT_GT(number("watchdog", "watchdog.time"), 0.5);
  EXPECT_NEAR(number("drive", "drive.readback"), 0.0225, 0.004);
  EXPECT_NEAR(number("drive", "drive.response"), 1.5e-4, 0.3e-4);
  EXPECT_NEAR(number("delays", "velocity.delay_s"), 0.0, 1e-3);
  EXPECT_EQ(commissioning::json_of(kept), commissioning::json_of(record));
}

TEST_F(AcceptanceOfABench, MissingDeviceIsFoundByTheIdentities) {
  bus.unplug(bridge);
  expect_failed("identities", "PhidgetBridge");
}

TEST_F(AcceptanceOfABench, OtherDevicesThanTheLabelsAreRefusedByThePerson) {
  actions.push_back({"by their labels", {}, "n"});
  expect_failed("identities", "Not the devices of this bench");
}

TEST_F(AcceptanceOfABench, OpenWireIsFoundByTheNoise) {
  board.wire(0, {Channel::displacement, volts_per_metre, 10.2});
  expect_failed("noise", "displacement from labjack_u6/AIN0 is at the end of its range");
}

TEST_F(AcceptanceOfABench, LouderChannelThanTheModelDeclaresIsFoundByTheNoise) {
  rig.model.sensors[index_of(Channel::displacement)].noise_std = 1e-9;
  expect_failed("noise", "The noise of displacement");
}

TEST_F(AcceptanceOfABench, WrongGainIsFoundByTheShunt) {
  on("as in \"100000 350\"").answer = "50000 350";
  expect_failed("shunt", "friction_force");
}

TEST_F(AcceptanceOfABench, ReversedSensorIsFoundByThePolarity) {
  board.wire(1, {Channel::velocity, -10.0, 0.0});
  expect_failed("polarity", "velocity fell");
}

TEST_F(AcceptanceOfABench, ExchangedWiresAreFoundByThePolarity) {
  durations.response_s = 1.5;
  board.wire(0, {Channel::base_displacement, volts_per_metre, 0.0});
  board.wire(2, {Channel::displacement, volts_per_metre, 0.0});
  expect_failed("polarity", "displacement did not respond. base_displacement did");
}

TEST_F(AcceptanceOfABench, LateChannelIsFoundByTheDelays) {
  hands.late_s[index_of(Channel::friction_force)] = 0.06;
  expect_failed("delays", "A model takes up to 30 ms");
  const auto late = measured_of(*record.find("delays"), "friction_force.delay_s");
  ASSERT_TRUE(late);
  EXPECT_NEAR(late->value, 0.06, 0.02);
  EXPECT_GT(late->sigma.value_or(0.0), 0.0);
}

TEST_F(AcceptanceOfABench, ButtonWithoutItsWireIsFoundByTheEmergencyStop) {
  durations.response_s = 1.0;
  on("press the emergency stop").act = {};
  expect_failed("emergency_stop", "did not react: press the emergency stop");
}

TEST_F(AcceptanceOfABench, CutWireThatReadsAsReleasedIsFoundByTheEmergencyStop) {
  durations.response_s = 1.0;
  on("pull its wire out").act = {};
  expect_failed("emergency_stop", "did not react: pull its wire out");
}

TEST_F(AcceptanceOfABench, FaultThatDoesNotArriveIsFoundByTheFaultLine) {
  durations.response_s = 1.0;
  on("make the amplifier report").act = {};
  expect_failed("amplifier_fault", "did not react");
}

TEST_F(AcceptanceOfABench, ActiveLineIsFoundBeforeAnythingIsDone) {
  durations.response_s = 1.0;
  hands.fault = true;
  expect_failed("amplifier_fault", "although nothing was done");
}

TEST_F(AcceptanceOfABench, DeviceThatDoesNotComeBackIsFoundByThePlugs) {
  durations.return_s = 2.0;
  on("plug phidget_bridge in").act = {};
  expect_failed("plugs", "phidget_bridge did not come back");
}

TEST_F(AcceptanceOfABench, LossThatIsNotNoticedIsFoundByThePlugs) {
  durations.response_s = 1.0;
  on("unplug phidget_bridge").act = {};
  on("plug phidget_bridge in").act = {};
  expect_failed("plugs", "The loss of phidget_bridge was not noticed");
}

TEST_F(AcceptanceOfABench, LateLoopIsFoundByItsTimes) {
  rig.safety.longest_overrun_s = 1e-5;
  expect_failed("timing", "an overrun");
}

TEST_F(AcceptanceOfABench, ContactThatStaysClosedIsFoundByTheWatchdog) {
  hands.when_on = [this] { contact_closed = true; };
  // The contact welds as soon as it is closed; afterwards it is mended, for the end of the test.
  std::jthread welder([this](const std::stop_token& ended) {
    while (!ended.stop_requested() && !contact_closed) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    board.set_contact_stuck(contact_closed);
  });
  expect_failed("watchdog", "stayed closed");
  welder.request_stop();
  welder.join();
  board.set_contact_stuck(false);
  EXPECT_EQ(made("identities").verdict, Verdict::passed);  // opening it releases the line
  hands.when_on = {};
}

TEST_F(AcceptanceOfABench, StuckOutputIsFoundByTheDrive) {
  board.set_dac_stuck(true);
  expect_failed("drive", "The output reads back with");
}

TEST_F(AcceptanceOfABench, StepsThatAreLeftOutAreRecordedAsNotDone) {
  actions.push_back({"[Enter] begins, s leaves this step out", {}, "s"});
  EXPECT_FALSE(accept());
  for (const StepRecord& each : record.steps) EXPECT_EQ(each.verdict, Verdict::not_done);
  EXPECT_EQ(record.steps.size(), commissioning::all_steps().size());
  EXPECT_FALSE(hands.ever_on);
}

TEST_F(AcceptanceOfABench, InterruptionLeavesTheAmplifierOffAndEverythingKept) {
  ASSERT_EQ(made("identities").verdict, Verdict::passed);
  hands.when_on = [this] { stop.request_stop(); };
  EXPECT_THROW(accept({"noise", "drive"}), diagnosis::Interrupted);
  EXPECT_TRUE(hands.ever_on);
  EXPECT_FALSE(hands.is_on());
  ASSERT_NE(kept.find("noise"), nullptr);
  EXPECT_EQ(kept.find("noise")->verdict, Verdict::passed);
  ASSERT_NE(kept.find("drive"), nullptr);
  EXPECT_EQ(kept.find("drive")->verdict, Verdict::not_done);
  hands.when_on = {};
  // Taken up again: steps that are passed are not made again.
  stop = std::stop_source();
  shown.clear();
  actions.push_back({"[Enter] begins, s leaves this step out", {}, "q"});
  EXPECT_FALSE(accept());
  EXPECT_THAT(shown, HasSubstr("(shunt)"));
  EXPECT_THAT(shown, testing::Not(HasSubstr("(noise)")));
}

}  // namespace
}  // namespace stickslip::emulated
