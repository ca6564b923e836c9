// SPDX-License-Identifier: Apache-2.0
#include "config/staleness.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace stickslip::config {

namespace {

constexpr double turnaround_s = 0.01;
constexpr double bridge_transfer_s = 0.02;
constexpr double scale_interval_s = 0.1;
constexpr double scale_line_characters = 25.0;

/// A request of a poll: its table, and the number of its registers or bits.
using Request = std::pair<RegisterTable, int>;

bool is_source(const Bench& bench, const std::string& device) {
  return std::any_of(bench.inputs.begin(), bench.inputs.end(),
                     [&device](const auto& input) { return input && input->device == device; });
}

std::vector<Request> requests_of(const ModbusUnit& unit, const BenchInputs& inputs) {
  const auto is_read = [&](const ModbusRegister& reg) {
    const bool wanted = std::any_of(inputs.begin(), inputs.end(), [&](const auto& input) {
      return input && input->device == unit.name && input->input == reg.name;
    });
    return reg.role == RegisterRole::status || reg.role == RegisterRole::alarm || wanted;
  };
  std::vector<Request> requests;
  struct Extent {
    int first = 65536;
    int end = 0;
  };
  std::map<std::pair<RegisterTable, std::string>, Extent> groups;
  for (const ModbusRegister& reg : unit.map.registers) {
    if (!is_read(reg)) continue;
    const auto size = static_cast<int>(registers_of(reg.type));
    if (reg.group.empty()) {
      requests.emplace_back(reg.table, size);
      continue;
    }
    Extent& extent = groups[{reg.table, reg.group}];
    extent.first = std::min(extent.first, reg.address);
    extent.end = std::max(extent.end, reg.address + size);
  }
  for (const auto& [group, extent] : groups) {
    requests.emplace_back(group.first, extent.end - extent.first);
  }
  return requests;
}

double duration_s(const ModbusUnit& unit, const Request& request) {
  double transmission_s = 0.0;
  if (unit.transport == ModbusTransport::rtu) {
    const bool bits = max_per_request(request.first) > 125;
    const double data = bits ? request.second / 8.0 + 1.0 : 2.0 * request.second;
    const double bits_per_character = 9.0 + (unit.parity == 'N' ? 0.0 : 1.0) + unit.stop_bits;
    constexpr double frames = 8.0 + 5.0;  // of the request, and around the data of the reply
    constexpr double silences = 2.0 * 3.5;
    transmission_s = (frames + data + silences) * bits_per_character / unit.baud;
  }
  return transmission_s + turnaround_s + unit.pause_between_requests_s;
}

bool has_confusable(std::vector<Request> requests) {
  std::sort(requests.begin(), requests.end());
  return std::adjacent_find(requests.begin(), requests.end()) != requests.end();
}

/// All units of a bus.
struct Bus {
  double requests_s = 0.0;  ///< one poll of each
  double longest_s = 0.0;   ///< request
  double timeout_s = 0.0;   ///< the longest
};

Bus bus_of(const Bench& bench, const ModbusUnit& unit) {
  Bus bus;
  for (const ModbusUnit& other : bench.modbus) {
    if (other.transport != unit.transport || other.port != unit.port) continue;
    for (const Request& request : requests_of(other, bench.inputs)) {
      const double request_s = duration_s(other, request);
      bus.requests_s += request_s;
      bus.longest_s = std::max(bus.longest_s, request_s);
    }
    bus.timeout_s = std::max(bus.timeout_s, other.timeout_s);
  }
  return bus;
}

double age_of(const Bench& bench, const ModbusUnit& unit) {
  const Bus bus = bus_of(bench, unit);
  const bool waits =
      unit.transport == ModbusTransport::rtu && has_confusable(requests_of(unit, bench.inputs));
  const double lost_s = std::max(bus.timeout_s, (waits ? 3.0 : 1.0) * unit.timeout_s);
  return std::max(unit.poll_period_s, bus.requests_s) + lost_s + bus.requests_s + bus.longest_s;
}

}  // namespace

std::vector<LongestAge> ages_after_a_lost_reply(const Bench& bench) {
  std::vector<LongestAge> ages;
  for (std::size_t i = 0; i < bench.modbus.size(); ++i) {
    const ModbusUnit& unit = bench.modbus[i];
    if (!is_source(bench, unit.name)) continue;
    ages.push_back({"modbus." + std::to_string(i), unit.name, age_of(bench, unit),
                    "a shorter poll_period_s or timeout_s, or registers read in one group"});
  }
  if (is_source(bench, "phidget_bridge")) {
    ages.push_back({"phidget_bridge", "phidget_bridge",
                    2.0e-3 * bench.phidget_bridge.interval_ms + bridge_transfer_s,
                    "a shorter interval_ms"});
  }
  for (std::size_t i = 0; i < bench.gauges.size(); ++i) {
    const GaugeAt& gauge = bench.gauges[i];
    if (!is_source(bench, gauge.name)) continue;
    switch (gauge.kind) {
      case GaugeKind::serial_scale:
        ages.push_back({"gauge." + std::to_string(i), gauge.name,
                        2.0 * scale_interval_s + scale_line_characters * 10.0 / gauge.baud,
                        "an instrument that transmits more often"});
    }
  }
  return ages;
}

}  // namespace stickslip::config
