// SPDX-License-Identifier: Apache-2.0
// Reading of a valid bench; problems_test.cpp has the errors.
#include "config/bench.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "config/modbus_map.h"
#include "config/readback.h"
#include "config/rig.h"

namespace stickslip::config {
namespace {

const std::filesystem::path rigs = std::filesystem::path(STICKSLIP_SOURCE_DIR) / "config";

TEST(Bench, ReadsAllKeysOfTheShippedBench) {
  const Rig rig = load_rig(rigs / "bench-u6.toml");
  EXPECT_EQ(rig.driver, DriverKind::bench);
  const Bench& bench = rig.bench;
  EXPECT_EQ(bench.board, BoardKind::labjack_u6);
  const auto& displacement = bench.inputs[index_of(Channel::displacement)];
  ASSERT_TRUE(displacement);
  EXPECT_EQ(displacement->device, "labjack_u6");
  EXPECT_EQ(displacement->input, "AIN0");
  EXPECT_EQ(displacement->range_v, 10.0);
  EXPECT_EQ(bench.inputs[index_of(Channel::friction_force)]->gain, 128);
  EXPECT_FALSE(bench.inputs[index_of(Channel::drive_force)]);
  EXPECT_EQ(bench.labjack_u6.enable_line, 0);
  EXPECT_EQ(bench.labjack_u6.emergency_stop_line, 2);
  EXPECT_FALSE(bench.labjack_u6.serial);
  EXPECT_EQ(bench.shaker.volts_per_unit, 150.0);
  EXPECT_EQ(bench.labjack_u6.rest_v, bench.shaker.rest_v);
  ASSERT_EQ(bench.modbus.size(), 1U);
  EXPECT_EQ(bench.modbus[0].name, "lvdt");
  EXPECT_EQ(bench.modbus[0].parity, 'E');
  EXPECT_EQ(bench.modbus[0].poll_period_s, 0.05);
  EXPECT_TRUE(rig.warnings.empty());
  EXPECT_EQ(bench.modbus[0].map_file, rigs / "modbus/orbit-acs-sample.toml");
  EXPECT_FALSE(bench.modbus[0].map.registers.empty());
  EXPECT_FALSE(bench.amplifier);
}

TEST(Bench, ReadsAllKeysOfTheShippedBenchOnEthernet) {
  const Rig rig = load_rig(rigs / "bench-t7.toml");
  const Bench& bench = rig.bench;
  EXPECT_EQ(bench.board, BoardKind::labjack_t7);
  EXPECT_EQ(bench.inputs[index_of(Channel::displacement)]->device, "labjack_t7");
  EXPECT_EQ(bench.labjack_t7.host, "192.168.1.207");
  EXPECT_EQ(bench.labjack_t7.port, 502);
  EXPECT_EQ(bench.labjack_t7.stream_port, 702);
  EXPECT_FALSE(bench.labjack_t7.serial);
  EXPECT_EQ(bench.labjack_t7.enable_line, 0);
  EXPECT_EQ(bench.labjack_t7.rest_v, bench.shaker.rest_v);
  EXPECT_EQ(output_of(bench), &bench.labjack_t7);
  EXPECT_TRUE(output_of(bench)->has_watchdog());
  EXPECT_TRUE(rig.warnings.empty());
}

TEST(Bench, ReadsTheDirectionOfSerialLines) {
  const Bench shipped = load_rig(rigs / "bench-u6.toml").bench;
  EXPECT_EQ(shipped.modbus[0].direction, Rs485Direction::automatic);
  const Bench bench = load_rig(STICKSLIP_TEST_DATA "/config/bench_rs485.toml").bench;
  ASSERT_EQ(bench.modbus.size(), 3U);
  EXPECT_EQ(bench.modbus[0].direction, Rs485Direction::kernel);
  EXPECT_EQ(bench.modbus[0].rts_while_sending, RtsState::asserted);
  EXPECT_EQ(bench.modbus[1].direction, Rs485Direction::rts);
  EXPECT_EQ(bench.modbus[1].rts_while_sending, RtsState::released);
  EXPECT_EQ(bench.modbus[2].direction, Rs485Direction::automatic);
}

TEST(Bench, ReadsTheReadbackOfTheOutputs) {
  const Rig rig = load_rig(STICKSLIP_TEST_DATA "/config/bench_readback.toml");
  const Readback& readback = rig.bench.readback;
  ASSERT_TRUE(readback.drive);
  EXPECT_EQ(readback.drive->input.device, "labjack_u6");
  EXPECT_EQ(readback.drive->input.input, "AIN12");
  EXPECT_EQ(readback.drive->input.range_v, 1.0);
  EXPECT_EQ(readback.drive->gain, 0.1);
  EXPECT_EQ(readback.drive->offset_v, 0.25);
  EXPECT_EQ(readback.drive->tolerance_v, 0.02);
  EXPECT_FALSE(readback.drive->delay_s);
  ASSERT_TRUE(readback.enable);
  EXPECT_EQ(readback.enable->input.input, "AIN13");
  EXPECT_EQ(readback.enable->on_above_v, 1.5);
  EXPECT_TRUE(readback.enable->active_low);
  EXPECT_EQ(readback.enable->delay_s, 0.3);
  EXPECT_EQ(readback.longest_overrun_s, 0.08);
  EXPECT_NEAR(drive_readback_limits(rig.bench, 1000.0).delay_s, 0.14, 1e-12);
  const Bench without = load_rig(rigs / "bench-u6.toml").bench;
  EXPECT_FALSE(without.readback.drive || without.readback.enable);
}

// The output of this board is paced, and may run dry for a while; its contact is that of a GPIO
// chip.
TEST(Bench, ReadbackOfAPacedOutputIsLaterByWhatIsQueued) {
  Bench bench = load_rig(STICKSLIP_TEST_DATA "/config/bench_readback_usb.toml").bench;
  ASSERT_TRUE(bench.readback.drive && bench.readback.enable);
  EXPECT_EQ(bench.readback.drive->input.input, "CH6");
  EXPECT_EQ(bench.readback.enable->input.input, "CH7");
  const auto drive_s = [&bench](double hz) { return drive_readback_limits(bench, hz).delay_s; };
  const auto enable_s = [&bench](double hz) { return enable_readback_limits(bench, hz).delay_s; };
  EXPECT_NEAR(drive_s(1000.0), 0.05 + 2 * 0.01 + 0.03 + 0.2, 1e-12);
  EXPECT_NEAR(drive_s(200.0), 0.05 + 2 * 32.0 / 1600.0 + 0.03 + 0.2, 1e-12);
  EXPECT_NEAR(drive_s(50.0), 0.05 + 2 * 0.02 + 0.03 + 0.2, 1e-12);
  EXPECT_NEAR(enable_s(1000.0), 0.05 + 2 * 0.01 + 0.05 + 0.3, 1e-12);
  EXPECT_NEAR(drive_readback_limits(bench, 1000.0).tolerance_v, 0.05 + 10.0 / 4096.0 + 0.01, 1e-12);
  for (auto& input : bench.inputs) {
    if (input) input->differential = true;
  }
  EXPECT_NEAR(drive_s(200.0), 0.05 + 2 * 32.0 / 800.0 + 0.03 + 0.2, 1e-12);
}

TEST(Bench, InputsOfADeviceExcludeThoseOfOthers) {
  const Rig rig = load_rig(rigs / "bench-u6.toml");
  const BenchInputs bridge = inputs_of(rig.bench.inputs, "phidget_bridge");
  EXPECT_TRUE(bridge[index_of(Channel::friction_force)]);
  EXPECT_TRUE(bridge[index_of(Channel::normal_load)]);
  EXPECT_FALSE(bridge[index_of(Channel::displacement)]);
  EXPECT_FALSE(bridge[index_of(Channel::base_displacement)]);
}

TEST(ModbusMap, ReadsAllKeysOfARegister) {
  const ModbusMap map = parse_modbus_map(R"(
schema = 1
name = "amplifier"
[[register]]
name = "current"
table = "input_registers"
address = 12
type = "int32"
order = "cdab"
scale = 0.01
offset = -3.0
unit = "A"
group = "values"
[[register]]
name = "state"
role = "alarm"
address = 7
ok = [0, 3]
mask = 19
[[register]]
name = "limit"
role = "setting"
address = 9
set_to = 2.5
write_single = true
)",
                                         "map.toml");
  ASSERT_EQ(map.registers.size(), 3U);
  EXPECT_EQ(map.name, "amplifier");
  const ModbusRegister& current = map.registers[0];
  EXPECT_EQ(current.role, RegisterRole::reading);
  EXPECT_EQ(current.table, RegisterTable::input_registers);
  EXPECT_EQ(current.address, 12);
  EXPECT_EQ(current.type, RegisterType::int32);
  EXPECT_EQ(current.order, ByteOrder::cdab);
  EXPECT_EQ(current.scale, 0.01);
  EXPECT_EQ(current.offset, -3.0);
  EXPECT_EQ(current.unit, "A");
  EXPECT_EQ(current.group, "values");
  EXPECT_EQ(map.registers[1].role, RegisterRole::alarm);
  EXPECT_EQ(map.registers[1].ok, (std::vector<std::int64_t>{0, 3}));
  EXPECT_EQ(map.registers[1].mask, 19);
  EXPECT_FALSE(map.registers[0].mask);
  EXPECT_EQ(map.registers[2].set_to, 2.5);
  EXPECT_TRUE(map.registers[2].write_single);
}

}  // namespace
}  // namespace stickslip::config
