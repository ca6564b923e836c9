// SPDX-License-Identifier: Apache-2.0
// Requests for a register map.
#include "drivers/modbus/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "drivers/modbus/value.h"

namespace stickslip::drivers::modbus {
namespace {

using config::ModbusMap;
using config::ModbusRegister;
using config::RegisterRole;
using config::RegisterTable;
using config::RegisterType;
using testing::ElementsAre;
using testing::IsEmpty;

ModbusRegister reg(std::string name, int address, std::string group = "",
                   RegisterType type = RegisterType::uint16,
                   RegisterTable table = RegisterTable::holding_registers,
                   RegisterRole role = RegisterRole::reading) {
  ModbusRegister out;
  out.name = std::move(name);
  out.address = address;
  out.group = std::move(group);
  out.type = type;
  out.table = table;
  out.role = role;
  return out;
}

ReadRequest holding(int address, int count) {
  return {RegisterTable::holding_registers, address, count};
}

TEST(ModbusPlan, ReadsNeededRegistersStatusAndAlarms) {
  ModbusMap map;
  map.registers = {
      reg("a", 1), reg("b", 2),
      reg("s", 3, "", RegisterType::uint16, RegisterTable::holding_registers, RegisterRole::status),
      reg("f", 4, "", RegisterType::bit, RegisterTable::coils, RegisterRole::alarm),
      reg("w", 5, "", RegisterType::uint16, RegisterTable::holding_registers,
          RegisterRole::setting)};
  const Plan plan = plan_requests(map, {"b"});
  EXPECT_THAT(plan.requests,
              ElementsAre(holding(2, 1), holding(3, 1), ReadRequest{RegisterTable::coils, 4, 1}));
  EXPECT_FALSE(plan.places[0]);
  EXPECT_EQ(plan.places[1], (Place{0, 0}));
  EXPECT_FALSE(plan.places[4]);
}

TEST(ModbusPlan, GroupIsOneRequestAcrossGapsInAnyOrder) {
  ModbusMap map;
  map.registers = {reg("late", 20, "g", RegisterType::float64), reg("first", 4, "g"),
                   reg("other", 9, "h"), reg("alone", 10),
                   reg("input", 6, "g", RegisterType::int32, RegisterTable::input_registers)};
  const Plan plan = plan_requests(map, {"late", "first", "other", "alone", "input"});
  EXPECT_THAT(plan.requests, ElementsAre(holding(4, 20), holding(9, 1), holding(10, 1),
                                         ReadRequest{RegisterTable::input_registers, 6, 2}));
  EXPECT_EQ(plan.places[0], (Place{0, 16}));
  EXPECT_EQ(plan.places[1], (Place{0, 0}));
}

TEST(ModbusPlan, LongGroupsAreSplitBetweenValues) {
  ModbusMap map;
  map.registers = {reg("a", 0, "g"), reg("b", 124, "g"), reg("c", 125, "g")};
  EXPECT_THAT(plan_requests(map, {"a", "b", "c"}).requests,
              ElementsAre(holding(0, 125), holding(125, 1)));
  map.registers[1] = reg("b", 124, "g", RegisterType::int32);
  EXPECT_THAT(plan_requests(map, {"a", "b"}).requests, ElementsAre(holding(0, 1), holding(124, 2)));
}

TEST(ModbusPlan, EmptyMapHasNoRequest) { EXPECT_THAT(plan_requests({}, {}).requests, IsEmpty()); }

RC_GTEST_PROP(ModbusPlan, EveryRegisterLiesWithinItsRequest, ()) {
  ModbusMap map;
  std::set<std::string> needed;
  const int count = *rc::gen::inRange(0, 20);
  for (int i = 0; i < count; ++i) {
    const auto table = static_cast<RegisterTable>(*rc::gen::inRange(0, 4));
    const bool bits = table == RegisterTable::coils || table == RegisterTable::discrete_inputs;
    const auto type =
        bits ? RegisterType::bit : static_cast<RegisterType>(*rc::gen::inRange(1, 10));
    ModbusRegister entry = reg(std::to_string(i), *rc::gen::inRange(0, 4000),
                               *rc::gen::element<std::string>("", "g", "h"), type, table);
    entry.role = static_cast<RegisterRole>(*rc::gen::inRange(0, 3));
    map.registers.push_back(entry);
    if (*rc::gen::arbitrary<bool>()) needed.insert(entry.name);
  }
  const Plan plan = plan_requests(map, needed);
  std::vector<bool> used(plan.requests.size());
  for (std::size_t i = 0; i < map.registers.size(); ++i) {
    const ModbusRegister& entry = map.registers[i];
    const bool wanted = entry.role != RegisterRole::reading || needed.contains(entry.name);
    RC_ASSERT(plan.places[i].has_value() == wanted);
    if (!wanted) continue;
    const ReadRequest& request = plan.requests[plan.places[i]->request];
    used[plan.places[i]->request] = true;
    RC_ASSERT(request.table == entry.table);
    RC_ASSERT(request.address + static_cast<int>(plan.places[i]->first) == entry.address);
    RC_ASSERT(plan.places[i]->first + registers_of(entry.type) <=
              static_cast<std::size_t>(request.count));
  }
  for (std::size_t i = 0; i < plan.requests.size(); ++i) {
    RC_ASSERT(used[i]);
    RC_ASSERT(plan.requests[i].count <= max_per_request(plan.requests[i].table));
  }
}

}  // namespace
}  // namespace stickslip::drivers::modbus
