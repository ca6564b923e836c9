// SPDX-License-Identifier: Apache-2.0
#include "config/staleness.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "config/rig.h"

namespace stickslip::config {
namespace {

ModbusRegister reading(const char* name, int address) {
  ModbusRegister reg;
  reg.name = name;
  reg.address = address;
  reg.type = RegisterType::float32;
  return reg;
}

Bench bench_of(const ModbusUnit& unit) {
  Bench bench;
  bench.modbus = {unit};
  bench.inputs[index_of(Channel::base_displacement)] = {"lvdt", "a"};
  return bench;
}

ModbusUnit lvdt() {
  ModbusUnit unit;
  unit.name = "lvdt";
  unit.port = "/dev/ttyUSB0";
  unit.map.registers = {reading("a", 0)};
  return unit;
}

double age_of(const Bench& bench) { return ages_after_a_lost_reply(bench).front().age_s; }

// The defaults fit together: none of these devices stops a rig by one lost reply.
TEST(Staleness, DefaultsSurviveALostReplyOfEachDevice) {
  Bench bench = bench_of(lvdt());
  bench.gauges = {{"scale", GaugeKind::serial_scale, "/dev/ttyUSB1"}};
  bench.inputs[index_of(Channel::normal_load)] = {"scale", "weight"};
  bench.inputs[index_of(Channel::friction_force)] = {"phidget_bridge", "0"};
  const auto ages = ages_after_a_lost_reply(bench);
  ASSERT_EQ(ages.size(), 3U);
  for (const LongestAge& each : ages) {
    EXPECT_LT(each.age_s, Safety{}.stale_after_s) << each.device;
    EXPECT_GT(each.age_s, 0.0) << each.device;
  }
}

TEST(Staleness, IsThePollTheTimeoutAndTheRequests) {
  ModbusUnit unit = lvdt();
  unit.transport = ModbusTransport::tcp;
  unit.poll_period_s = 0.5;
  unit.timeout_s = 0.25;
  EXPECT_NEAR(age_of(bench_of(unit)), 0.5 + 0.25 + 2 * 0.01, 1e-12);
  unit.pause_between_requests_s = 0.1;
  EXPECT_NEAR(age_of(bench_of(unit)), 0.5 + 0.25 + 2 * 0.11, 1e-12);
  unit.poll_period_s = 0.001;  // faster than the bus
  EXPECT_NEAR(age_of(bench_of(unit)), 0.11 + 0.25 + 2 * 0.11, 1e-12);
}

// A late reply to one would pass for that to the other, so that it is awaited.
TEST(Staleness, RequestsOfOneFormCostTwoMoreTimeouts) {
  ModbusUnit unit = lvdt();
  ModbusRegister status = reading("b", 10);
  status.role = RegisterRole::status;
  unit.map.registers.push_back(status);
  const double alike = age_of(bench_of(unit));
  unit.map.registers[1].type = RegisterType::uint16;
  EXPECT_GT(alike - age_of(bench_of(unit)), 2 * unit.timeout_s);
  for (ModbusRegister& reg : unit.map.registers) reg.group = std::string("group");
  EXPECT_LT(age_of(bench_of(unit)), alike - 2 * unit.timeout_s);
}

TEST(Staleness, OtherUnitsOfTheBusCount) {
  Bench bench = bench_of(lvdt());
  const double alone = age_of(bench);
  ModbusUnit slow = lvdt();
  slow.name = "amplifier";
  slow.timeout_s = 0.4;
  slow.map.registers[0].role = RegisterRole::alarm;
  bench.modbus.push_back(slow);
  EXPECT_GT(age_of(bench), alone + 0.3);
  ASSERT_EQ(ages_after_a_lost_reply(bench).size(), 1U) << "it is the source of no channel";
  bench.modbus[1].port = "/dev/ttyUSB1";
  EXPECT_EQ(age_of(bench), alone);
}

}  // namespace
}  // namespace stickslip::config
