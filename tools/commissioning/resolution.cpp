// SPDX-License-Identifier: Apache-2.0
#include "tools/commissioning/resolution.h"

#include <algorithm>
#include <cmath>

namespace stickslip::commissioning {

namespace {

double step_of(const config::ModbusUnit& unit, const std::string& name) {
  const auto& registers = unit.map.registers;
  const auto found = std::find_if(registers.begin(), registers.end(),
                                  [&name](const auto& each) { return each.name == name; });
  if (found == registers.end()) return 0.0;
  const bool floating =
      found->type == config::RegisterType::float32 || found->type == config::RegisterType::float64;
  return floating ? 0.0 : std::abs(found->scale);
}

}  // namespace

double step_of(const config::Rig& rig, Channel channel) {
  const auto& input = rig.bench.inputs[index_of(channel)];
  if (!input) return 0.0;
  if (input->device == config::name_of(config::BoardKind::usb_1208fs_plus)) {
    const double codes = input->differential ? 4096.0 : 2048.0;
    return 2.0 * input->range_v / codes;
  }
  for (const config::ModbusUnit& unit : rig.bench.modbus) {
    if (unit.name == input->device) return step_of(unit, input->input);
  }
  return 0.0;
}

}  // namespace stickslip::commissioning
