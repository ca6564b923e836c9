// SPDX-License-Identifier: Apache-2.0
// Serial lines: adapters that delay received bytes.
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tools/doctor/examination.h"
#include "tools/doctor/udev_rules.h"

namespace stickslip::doctor {

namespace {

constexpr double short_latency_ms = 2.0;
/// A delay matters above this part of a poll period: it limits the rate of the polls, and the time
/// of a reading is midway between request and reply.
constexpr double part_of_period = 0.1;

constexpr const char* adapters = "/sys/bus/usb-serial/devices";
// As in systemd/70-stickslip.rules.
constexpr const char* rule =
    R"(ACTION=="add|bind|change", SUBSYSTEM=="usb-serial", DRIVERS=="ftdi_sio", )"
    R"(TEST=="latency_timer", ATTR{latency_timer}="1")";

std::string latency_file(const std::string& adapter) {
  return std::string(adapters) + "/" + adapter + "/latency_timer";
}

struct Adapter {
  std::string name;  ///< "ttyUSB0"
  double latency_ms = 0.0;
  std::optional<double> poll_period_s;  ///< of the Modbus units on its line

  bool is_short() const { return latency_ms <= short_latency_ms; }
  bool delays_polls() const {
    return !is_short() && poll_period_s && 1e-3 * latency_ms > part_of_period * *poll_period_s;
  }
  std::string text() const {
    const std::string latency = short_number(latency_ms);
    if (is_short()) return "/dev/" + name + " passes received bytes on within " + latency + " ms";
    std::string out = "/dev/" + name + " holds received bytes back for " + latency + " ms";
    if (!poll_period_s) return out;
    return out + ": each reply is up to " + latency + " ms late, in a poll period of " +
           short_number(1e3 * *poll_period_s) + " ms";
  }
};

/// Only FTDI's driver has a latency timer.
std::optional<Adapter> ftdi_adapter(const Host& host, const std::string& name) {
  const auto latency = host.read(latency_file(name));
  if (!latency) return std::nullopt;
  return Adapter{name, std::atof(latency->c_str()), std::nullopt};
}

std::vector<Adapter> adapters_of(const Host& host, const Requirements& required) {
  std::vector<Adapter> out;
  if (required.config_file.empty()) {
    for (const std::string& name : host.names_in(adapters)) {
      if (auto adapter = ftdi_adapter(host, name)) out.push_back(*adapter);
    }
    return out;
  }
  for (const ModbusLine& line : required.modbus_lines) {
    auto adapter = ftdi_adapter(host, host.resolved(line.port).filename().string());
    if (!adapter) continue;
    adapter->poll_period_s = line.poll_period_s;
    out.push_back(*adapter);
  }
  return out;
}

/// For now by the timer itself, for the next time that the adapter is plugged in by a rule.
std::string shorten_command(const Host& host, const std::set<std::string>& names) {
  const std::string file = rules_file(host);
  const std::string rules = file.empty() ? "" : host.read(file).value_or("");
  if (rules.find("latency_timer") != std::string::npos) return apply_rules_command;
  std::string command = "echo 1 | sudo tee";
  for (const std::string& name : names) command.append(" ").append(latency_file(name));
  return command + " && echo '" + rule + "' | sudo tee /etc/udev/rules.d/70-stickslip-ftdi.rules";
}

}  // namespace

Finding check_serial_latency(const Host& host, const Requirements& required) {
  const std::string check = "serial latency";
  const bool for_rig = !required.config_file.empty();
  if (for_rig && required.modbus_lines.empty()) {
    return {check, Verdict::note, "the rig has no Modbus unit on a serial line", ""};
  }
  const std::vector<Adapter> present = adapters_of(host, required);
  if (present.empty()) {
    return {check, Verdict::note,
            for_rig ? "no FTDI adapter on the Modbus lines of the rig" : "no FTDI adapter present",
            ""};
  }
  Verdict verdict = Verdict::ok;
  std::string found;
  std::set<std::string> slow;
  for (const Adapter& adapter : present) {
    found += (found.empty() ? "" : "; ") + adapter.text();
    const bool unused = !adapter.is_short() && !adapter.poll_period_s;
    if (adapter.delays_polls() || unused) slow.insert(adapter.name);
    if (adapter.delays_polls()) verdict = Verdict::warn;
    if (unused) verdict = Verdict::note;
  }
  return {check, verdict, found, slow.empty() ? "" : shorten_command(host, slow)};
}

}  // namespace stickslip::doctor
