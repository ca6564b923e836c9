// SPDX-License-Identifier: Apache-2.0
// The shipped register maps: each is a sample or names its sources, and reads registers as its
// sources have them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include "config/modbus_map.h"
#include "drivers/modbus/plan.h"
#include "drivers/modbus/value.h"

namespace stickslip::drivers::modbus {
namespace {

using config::ModbusMap;
using config::ModbusRegister;
using config::RegisterRole;
using config::RegisterTable;
using testing::ElementsAre;
using testing::HasSubstr;

const std::filesystem::path folder =
    std::filesystem::path(STICKSLIP_SOURCE_DIR) / "config" / "modbus";

ModbusMap shipped(const std::string& name) {
  return config::load_modbus_map(folder / (name + ".toml"));
}

ModbusRegister reg(const std::string& map, const std::string& name) {
  const ModbusMap loaded = shipped(map);
  const auto found = std::find_if(loaded.registers.begin(), loaded.registers.end(),
                                  [&](const ModbusRegister& each) { return each.name == name; });
  if (found == loaded.registers.end()) throw std::runtime_error(map + " has no " + name);
  return *found;
}

/// True if the unit's readings are valid with a status of these words.
bool is_ok(const ModbusRegister& status, const std::vector<std::uint16_t>& words) {
  const auto raw = raw_of(status, words);
  return raw && std::find(status.ok.begin(), status.ok.end(), *raw) != status.ok.end();
}

TEST(ShippedMaps, AreSamplesByTheirNamesOrNameTheirSources) {
  std::size_t maps = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    SCOPED_TRACE(entry.path().string());
    const std::string name = entry.path().stem().string();
    const ModbusMap map = shipped(name);
    std::ifstream stream(entry.path());
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    if (name.ends_with("-sample")) {
      EXPECT_THAT(map.name, HasSubstr("(sample)"));
      EXPECT_THAT(text, HasSubstr("CHECK BEFORE USE"));
    } else {
      EXPECT_THAT(map.name, testing::Not(HasSubstr("sample")));
      EXPECT_THAT(text, HasSubstr("\n# Sources:\n"));
      EXPECT_THAT(text, HasSubstr("\n# In the unit: "));
      EXPECT_THAT(text, HasSubstr("\n# Not tried with a real unit"));
    }
    EXPECT_TRUE(std::any_of(map.registers.begin(), map.registers.end(), [](const auto& each) {
      return each.role == RegisterRole::reading && !each.unit.empty();
    }));
    ++maps;
  }
  EXPECT_GE(maps, 6U);
}

TEST(ShippedMaps, ReadRegistersAsTheirSourcesHaveThem) {
  const struct {
    std::string map;
    std::string name;
    RegisterTable table;
    int address;
    std::vector<std::uint16_t> words;
    double si;
  } cases[] = {
      // Example of Seneca's manual, MI-005370-EN revision 6, page 43.
      {"seneca-ze-sg3", "net", RegisterTable::holding_registers, 63, {0x4022, 0x8F5C}, 2.54},
      {"seneca-ze-sg3", "gross", RegisterTable::holding_registers, 65, {0xC022, 0x8F5C}, -2.54},
      // 0 to 65535 for -10 to +10 V.
      {"advantech-adam-6217", "ai0", RegisterTable::holding_registers, 0, {0}, -10.0},
      {"advantech-adam-6217", "ai0", RegisterTable::holding_registers, 0, {65535}, 10.0},
      {"advantech-adam-6217", "ai0", RegisterTable::holding_registers, 0, {45874}, 3.9998474},
      // uA.
      {"waveshare-analog-input-8ch", "ai1", RegisterTable::input_registers, 0, {12000}, 0.012},
      {"waveshare-analog-input-8ch", "ai4", RegisterTable::input_registers, 3, {20000}, 0.020},
      // Volts as floats.
      {"labjack-t7", "AIN0", RegisterTable::holding_registers, 0, {0x3FC0, 0}, 1.5},
      {"labjack-t7", "AIN3", RegisterTable::holding_registers, 6, {0xC120, 0}, -10.0},
      // Example of Mantracourt's manual: -12345.678 is C640 E6B6, the low word first.
      {"dsc-sample", "output", RegisterTable::holding_registers, 18, {0xE6B6, 0xC640}, -12345.678},
  };
  for (const auto& each : cases) {
    SCOPED_TRACE(each.map + ", " + each.name);
    const ModbusRegister own = reg(each.map, each.name);
    EXPECT_EQ(own.table, each.table);
    EXPECT_EQ(own.address, each.address);
    const auto value = value_of(own, each.words);
    ASSERT_TRUE(value);
    EXPECT_NEAR(*value, each.si, 1e-7 * std::max(1.0, std::abs(each.si)));
  }
}

TEST(ShippedMaps, StatusInvalidatesReadings) {
  const ModbusRegister cell = reg("seneca-ze-sg3", "status");
  EXPECT_EQ(cell.address, 77);
  EXPECT_TRUE(is_ok(cell, {0}));
  EXPECT_TRUE(is_ok(cell, {0x01FD})) << "all but the full scale of the cell";
  EXPECT_FALSE(is_ok(cell, {0x0012})) << "standstill at full scale";
  const ModbusRegister channel = reg("advantech-adam-6217", "status_0");
  EXPECT_EQ(channel.address, 100);
  EXPECT_TRUE(is_ok(channel, {0, 0}));
  for (const std::uint16_t fault : std::vector<std::uint16_t>{1, 2, 4, 8, 128, 512}) {
    EXPECT_FALSE(is_ok(channel, {fault, 0})) << fault;
  }
}

TEST(ShippedMaps, SettingsAreWrittenAsTheirSourcesHaveThem) {
  const ModbusRegister range = reg("advantech-adam-6217", "range_0");
  EXPECT_EQ(range.address, 200);
  EXPECT_EQ(words_for(range, *range.set_to)->word[0], 0x0143);
  const ModbusRegister mode = reg("waveshare-analog-input-8ch", "mode_1");
  EXPECT_EQ(mode.address, 0x1000);
  EXPECT_EQ(words_for(mode, *mode.set_to)->word[0], 2);
  for (const ModbusRegister& each : {range, mode}) {
    EXPECT_EQ(each.role, RegisterRole::setting);
    EXPECT_EQ(each.table, RegisterTable::holding_registers);
    EXPECT_TRUE(each.write_single);
  }
}

TEST(ShippedMaps, ReadWeightAndStatusAtOnce) {
  EXPECT_THAT(plan_requests(shipped("seneca-ze-sg3"), {"net"}).requests,
              ElementsAre(ReadRequest{RegisterTable::holding_registers, 63, 15}));
}

}  // namespace
}  // namespace stickslip::drivers::modbus
