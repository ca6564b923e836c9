// SPDX-License-Identifier: Apache-2.0
#include "drivers/modbus/plan.h"

#include <algorithm>
#include <map>
#include <utility>

#include "drivers/modbus/value.h"

namespace stickslip::drivers::modbus {

namespace {

using config::ModbusRegister;
using config::RegisterRole;

bool is_read(const ModbusRegister& reg, const std::set<std::string>& needed) {
  return reg.role == RegisterRole::status || reg.role == RegisterRole::alarm ||
         needed.contains(reg.name);
}

int end_of(const ModbusRegister& reg) {
  return reg.address + static_cast<int>(registers_of(reg.type));
}

/// Members of one group and table, as indices in the map.
using Group = std::vector<std::size_t>;

std::vector<Group> groups_of(const config::ModbusMap& map, const std::set<std::string>& needed) {
  std::vector<Group> groups;
  std::map<std::pair<std::string, config::RegisterTable>, std::size_t> known;
  for (std::size_t i = 0; i < map.registers.size(); ++i) {
    const ModbusRegister& reg = map.registers[i];
    if (!is_read(reg, needed)) continue;
    if (reg.group.empty()) {
      groups.push_back({i});
      continue;
    }
    const auto [entry, is_new] = known.try_emplace({reg.group, reg.table}, groups.size());
    if (is_new) groups.emplace_back();
    groups[entry->second].push_back(i);
  }
  return groups;
}

void add_group(const config::ModbusMap& map, Group group, Plan& plan) {
  std::stable_sort(group.begin(), group.end(), [&map](std::size_t a, std::size_t b) {
    return map.registers[a].address < map.registers[b].address;
  });
  const std::size_t first_request = plan.requests.size();
  for (const std::size_t i : group) {
    const ModbusRegister& reg = map.registers[i];
    const bool fits = plan.requests.size() > first_request &&
                      end_of(reg) - plan.requests.back().address <= max_per_request(reg.table);
    if (!fits) plan.requests.push_back({reg.table, reg.address, 0});
    ReadRequest& request = plan.requests.back();
    request.count = std::max(request.count, end_of(reg) - request.address);
    plan.places[i] = {plan.requests.size() - 1,
                      static_cast<std::size_t>(reg.address - request.address)};
  }
}

}  // namespace

Plan plan_requests(const config::ModbusMap& map, const std::set<std::string>& needed) {
  Plan plan;
  plan.places.resize(map.registers.size());
  for (const Group& group : groups_of(map, needed)) add_group(map, group, plan);
  return plan;
}

}  // namespace stickslip::drivers::modbus
