// SPDX-License-Identifier: Apache-2.0
#include "config/modbus_map.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <utility>

#include "config/document.h"
#include "physics/problem.h"

namespace stickslip::config {

namespace {

bool holds_bits(RegisterTable table) {
  return table == RegisterTable::coils || table == RegisterTable::discrete_inputs;
}

// Consistency of the keys of one register.
void check(Document& document, const std::string& at, const ModbusRegister& entry) {
  const auto report = [&](const char* key, const std::string& message) {
    document.report(at + key, message);
  };
  const bool bits = holds_bits(entry.table);
  if (bits != (entry.type == RegisterType::bit)) {
    report("type", bits ? "coils and discrete inputs hold bits: expected type = \"bit\""
                        : "bits are in tables of bits: expected table = \"coils\" or "
                          "\"discrete_inputs\", or another type");
  }
  if (entry.scale == 0.0) report("scale", "is 0: every value would be the same");
  if (static_cast<std::size_t>(entry.address) + registers_of(entry.type) > 65536) {
    report("address", "is too high: a value of " + std::to_string(registers_of(entry.type)) +
                          " registers would reach beyond 65535");
  }
  if (entry.mask) {
    for (const std::int64_t value : entry.ok) {
      if ((value & *entry.mask) == value) continue;
      report("ok", std::to_string(value) + " has bits outside of mask = " +
                       std::to_string(*entry.mask) + ": the register never equals it");
    }
  }
  const bool writable =
      entry.table == RegisterTable::coils || entry.table == RegisterTable::holding_registers;
  if (entry.role == RegisterRole::setting && !writable) {
    report("table", "cannot be written: expected coils or holding_registers");
  }
  if (entry.write_single && registers_of(entry.type) > 1) {
    report("write_single", "function 6 writes one register, and this value has " +
                               std::to_string(registers_of(entry.type)));
  }
}

// A group is sampled simultaneously because it is one request.
void check_groups(Document& document, const ModbusMap& map) {
  struct Extent {
    int first = 65536;
    int end = 0;
    bool reported = false;
  };
  std::map<std::pair<std::string, RegisterTable>, Extent> extents;
  for (std::size_t i = 0; i < map.registers.size(); ++i) {
    const ModbusRegister& reg = map.registers[i];
    if (reg.group.empty() || reg.role == RegisterRole::setting) continue;
    Extent& extent = extents[{reg.group, reg.table}];
    extent.first = std::min(extent.first, reg.address);
    extent.end = std::max(extent.end, reg.address + static_cast<int>(registers_of(reg.type)));
    const int most = max_per_request(reg.table);
    if (extent.end - extent.first <= most || extent.reported) continue;
    extent.reported = true;
    document.report("register." + std::to_string(i) + ".group",
                    "group \"" + reg.group + "\" extends from address " +
                        std::to_string(extent.first) + " to " + std::to_string(extent.end - 1) +
                        ", which is " + std::to_string(extent.end - extent.first) +
                        "; one request reads at most " + std::to_string(most) +
                        (holds_bits(reg.table) ? " bits" : " registers") +
                        ": put distant registers into different groups");
  }
}

}  // namespace

int max_per_request(RegisterTable table) { return holds_bits(table) ? 2000 : 125; }

std::size_t registers_of(RegisterType type) {
  switch (type) {
    case RegisterType::bit:
    case RegisterType::uint16:
    case RegisterType::int16:
    case RegisterType::bcd16:
      return 1;
    case RegisterType::uint32:
    case RegisterType::int32:
    case RegisterType::float32:
    case RegisterType::bcd32:
      return 2;
    case RegisterType::int64:
    case RegisterType::float64:
      return 4;
  }
  return 1;
}

ModbusMap parse_modbus_map(std::string_view text, const std::string& name) {
  Document document(text, name, keys_of<ModbusMap>());
  ModbusMap map;
  if (document.sound()) {
    document.read(map);
    std::set<std::string> names;
    for (std::size_t i = 0; i < map.registers.size(); ++i) {
      const std::string at = "register." + std::to_string(i) + ".";
      check(document, at, map.registers[i]);
      if (!names.insert(map.registers[i].name).second) {
        document.report(at + "name", "already names another register");
      }
    }
    check_groups(document, map);
  }
  if (!document.sound()) throw InputError(document.take_problems());
  return map;
}

ModbusMap load_modbus_map(const std::filesystem::path& file) {
  return parse_modbus_map(read_text(file), file.string());
}

}  // namespace stickslip::config
