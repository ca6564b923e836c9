// SPDX-License-Identifier: Apache-2.0
#include "config/bench_document.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <set>
#include <string_view>

#include "config/names.h"
#include "config/staleness.h"
#include "physics/number_text.h"
#include "physics/problem.h"

namespace stickslip::config {

namespace {

constexpr double u6_samples_per_s = 50'000.0;
constexpr double t7_samples_per_s = 100'000.0;
constexpr double t7_samples_per_packet = 512.0;
constexpr double usb_1208fs_samples_per_s = 51'200.0;
constexpr int labjack_inputs = 14;
constexpr int usb_1208fs_inputs = 8;
constexpr std::array labjack_ranges_v = {10.0, 1.0, 0.1, 0.01};
constexpr std::array usb_1208fs_ranges_v = {20.0, 10.0, 5.0, 4.0, 2.5, 2.0, 1.25, 1.0};
constexpr std::array bridge_gains = {1, 8, 16, 32, 64, 128};
constexpr std::string_view bridge = "phidget_bridge";

std::string short_of(double value) { return physics::number_text(value, 6); }

/// The number after `prefix` in "AIN3", if below `count`.
std::optional<int> numbered(std::string_view text, std::string_view prefix, int count) {
  if (!text.starts_with(prefix)) return std::nullopt;
  text.remove_prefix(prefix.size());
  int number = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool whole = error == std::errc{} && end == text.data() + text.size();
  const bool canonical = whole && std::to_string(number) == text;
  if (!canonical || number < 0 || number >= count) return std::nullopt;
  return number;
}

void read_map(Document& document, std::size_t position, ModbusUnit& unit) {
  std::string text;
  try {
    text = read_text(unit.map_file);
  } catch (const InputError& error) {
    document.report("modbus." + std::to_string(position) + ".map",
                    unit.map_file.string() + ": " + error.problems().front().message);
    return;
  }
  try {
    unit.map = parse_modbus_map(text, unit.map_file.string());
  } catch (const InputError& error) {
    document.add(error.problems());
  }
}

/// Reports inputs that are not DEVICE/INPUT, and removes them.
void check_form(Document& document, BenchInputs& inputs) {
  for (const Channel channel : all_channels) {
    const std::string path = "inputs." + std::string(info(channel).stem);
    auto& input = inputs[index_of(channel)];
    if (!document.has(path) || (input && !input->device.empty())) continue;
    input.reset();
    const std::string from = document.text(path + ".from").value_or("");
    document.report(path + ".from",
                    (from.empty() ? std::string("is missing") : "is \"" + from + '"') +
                        ": expected DEVICE/INPUT, such as \"labjack_u6/AIN0\"");
  }
}

/// Likewise for inputs that read outputs back.
void check_form(Document& document, Readback& readback) {
  const auto check = [&document](const char* path, auto& output) {
    if (!output || !output->input.device.empty()) return;
    output.reset();
    const std::string from = document.text(path).value_or("");
    if (from.empty()) return;  // reported as missing
    document.report(path,
                    "is \"" + from + "\": expected DEVICE/INPUT, such as \"labjack_u6/AIN12\"");
  };
  check("readback.drive.from", readback.drive);
  check("readback.enable.from", readback.enable);
}

/// Checks of a bench beyond those of single keys.
class Checker {
 public:
  Checker(Document& document, const Rig& rig)
      : document_(document),
        rig_(rig),
        bench_(rig.bench),
        board_(name_of(rig.bench.board)),
        output_(output_of(rig.bench)),
        labjack_(output_ != nullptr) {}

  void check() {
    check_units();
    for (const Channel channel : all_channels) {
      if (bench_.inputs[index_of(channel)]) check_input(channel, *bench_.inputs[index_of(channel)]);
    }
    const BenchInputs on_board = inputs_of(bench_.inputs, board_);
    const auto count = std::count_if(on_board.begin(), on_board.end(),
                                     [](const auto& input) { return input.has_value(); });
    if (count == 0) {
      document_.report("inputs", "no channel comes from " + board_ +
                                     ", whose scans are the frames: expected one or more from \"" +
                                     board_ + "/...\"");
    }
    check_readback();
    check_alike();
    const int spare = (bench_.readback.drive ? 1 : 0) + (bench_.readback.enable ? 1 : 0);
    check_rate(static_cast<double>(count + spare));
    check_packet(static_cast<double>(count + spare));
    check_lines();
    check_dead_daemon();
    check_shaker();
    warn_of_losses();
    if (bench_.phidget_bridge.interval_ms % 8 != 0) {
      document_.report("phidget_bridge.interval_ms",
                       "is not a multiple of 8, the step of the bridge");
    }
  }

 private:
  void check_name(const std::string& at, const std::string& name) {
    const bool board = value_in(names<BoardKind>, name).has_value();
    if (name.find('/') != std::string::npos || name == bridge || board) {
      document_.report(at, "\"" + name +
                               "\" cannot name a device: expected a name without '/' that no other "
                               "device has");
    } else if (!names_.insert(name).second) {
      document_.report(at, "\"" + name + "\" already names another device");
    }
  }

  void check_units() {
    for (std::size_t i = 0; i < bench_.gauges.size(); ++i) {
      check_name("gauge." + std::to_string(i) + ".name", bench_.gauges[i].name);
    }
    std::map<std::string, const ModbusUnit*> ports;
    for (std::size_t i = 0; i < bench_.modbus.size(); ++i) {
      const ModbusUnit& unit = bench_.modbus[i];
      const std::string at = "modbus." + std::to_string(i) + ".";
      check_name(at + "name", unit.name);
      if (unit.transport == ModbusTransport::rtu && unit.unit > 247) {
        document_.report(at + "unit", "is " + std::to_string(unit.unit) +
                                          ": expected 1 to 247 on a serial line");
      }
      if (unit.transport == ModbusTransport::tcp) check_host(at, unit.port);
      const auto [shared, first] = ports.emplace(unit.port, &unit);
      if (!first) check_bus(at, unit, *shared->second);
    }
  }

  void check_host(const std::string& at, const std::string& port) {
    const auto colon = port.rfind(':');
    const bool named = colon != std::string::npos && colon > 0;
    if (!named || !numbered(port.substr(colon + 1), "", 65536)) {
      document_.report(at + "port", "is \"" + port +
                                        "\": expected HOST:PORT, such as "
                                        "\"192.168.0.5:502\"");
    }
  }

  void check_bus(const std::string& at, const ModbusUnit& unit, const ModbusUnit& other) {
    if (unit.transport != other.transport || unit.baud != other.baud ||
        unit.parity != other.parity || unit.stop_bits != other.stop_bits ||
        unit.direction != other.direction || unit.rts_while_sending != other.rts_while_sending) {
      document_.report(at + "port", "shares the bus of \"" + other.name +
                                        "\" with other settings: transport, baud, parity, "
                                        "stop_bits, direction and rts_while_sending are the same "
                                        "for all units of a bus");
    }
    if (unit.unit == other.unit) {
      document_.report(at + "unit", "is already that of \"" + other.name + "\" on the same bus");
    }
  }

  void check_input(Channel channel, const BenchInput& input) {
    const std::string path = "inputs." + std::string(info(channel).stem);
    const std::string from = input.device + "/" + input.input;
    const auto [taken, first] = taken_.emplace(from, info(channel).stem);
    if (!first) {
      document_.report(path + ".from",
                       "\"" + from + "\" is already the source of " + taken->second);
    }
    if (input.device == board_) {
      check_board_input(path, input);
    } else if (input.device == bridge) {
      check_bridge_input(path, input);
    } else {
      check_register(path, input);
    }
    refuse_unused(path, input.device == board_, {"range_v", "differential"}, "inputs of a board");
    refuse_unused(path, input.device == bridge, {"gain"}, "inputs of a bridge");
  }

  void check_readback() {
    const auto check = [this](const std::string& table, const BenchInput& input) {
      const std::string from = input.device + "/" + input.input;
      if (input.device != board_) {
        document_.report(table + ".from", "is \"" + from +
                                              "\": outputs are read back by spare inputs of the "
                                              "board, " +
                                              board_);
        return;
      }
      const auto [taken, first] = taken_.emplace(from, table);
      if (!first) {
        document_.report(table + ".from",
                         "\"" + from + "\" is already the source of " + taken->second);
      }
      check_board_input(table, input);
    };
    if (bench_.readback.drive) {
      check("readback.drive", bench_.readback.drive->input);
      if (bench_.readback.drive->gain == 0.0) {
        document_.report("readback.drive.gain", "is 0: every output would read alike");
      }
    }
    if (bench_.readback.enable) check("readback.enable", bench_.readback.enable->input);
  }

  /// A USB-1208FS-Plus has one mode for all of its inputs.
  void check_alike() {
    if (labjack_) return;
    std::string first;
    bool differential = false;
    const auto check = [&](const std::string& table, const BenchInput& input) {
      if (input.device != board_) return;
      if (first.empty()) {
        first = table;
        differential = input.differential;
      } else if (input.differential != differential) {
        document_.report(table + ".differential", "differs from that of " + first +
                                                      ": the inputs of " + board_ +
                                                      " are all single-ended or all differential");
      }
    };
    for (const Channel channel : all_channels) {
      const auto& input = bench_.inputs[index_of(channel)];
      if (input) check("inputs." + std::string(info(channel).stem), *input);
    }
    if (bench_.readback.drive) check("readback.drive", bench_.readback.drive->input);
    if (bench_.readback.enable) check("readback.enable", bench_.readback.enable->input);
  }

  void refuse_unused(const std::string& path, bool used, std::initializer_list<const char*> names,
                     const char* whose) {
    for (const char* name : names) {
      const std::string at = path + "." + name;
      if (!used && document_.has(at)) {
        document_.report(at, std::string("is for ") + whose + " only: remove it");
      }
    }
  }

  void check_board_input(const std::string& path, const BenchInput& input) {
    const int inputs = labjack_ ? labjack_inputs : input.differential ? 4 : usb_1208fs_inputs;
    const char* prefix = labjack_ ? "AIN" : "CH";
    const auto number = numbered(input.input, prefix, inputs);
    if (!number || (labjack_ && input.differential && *number % 2 != 0)) {
      document_.report(path + ".from",
                       "\"" + input.input + "\" is " +
                           (input.differential ? "not a differential " : "not an ") + "input of " +
                           board_ + ": expected " + prefix + "0 to " + prefix +
                           std::to_string(inputs - 1) +
                           (labjack_ && input.differential ? ", the even ones" : ""));
    }
    check_range(path, input);
  }

  void check_range(const std::string& path, const BenchInput& input) {
    std::vector<double> ranges(labjack_ranges_v.begin(), labjack_ranges_v.end());
    if (!labjack_) ranges.assign(usb_1208fs_ranges_v.begin(), usb_1208fs_ranges_v.end());
    if (!labjack_ && !input.differential) ranges = {10.0};
    if (std::find(ranges.begin(), ranges.end(), input.range_v) != ranges.end()) return;
    std::string list;
    for (const double range : ranges) list += (list.empty() ? "" : ", ") + short_of(range);
    document_.report(path + ".range_v", "is " + short_of(input.range_v) + " V, which " + board_ +
                                            " does not have for this input: expected " + list);
  }

  void check_bridge_input(const std::string& path, const BenchInput& input) {
    if (!numbered(input.input, "", 4)) {
      document_.report(path + ".from", "\"" + input.input +
                                           "\" is not an input of a bridge: expected 0, 1, 2 or 3");
    }
    if (std::find(bridge_gains.begin(), bridge_gains.end(), input.gain) == bridge_gains.end()) {
      document_.report(path + ".gain",
                       "is " + std::to_string(input.gain) + ": expected 1, 8, 16, 32, 64 or 128");
    }
  }

  void check_register(const std::string& path, const BenchInput& input) {
    std::string known = board_ + ", phidget_bridge";
    for (const GaugeAt& gauge : bench_.gauges) {
      known += ", " + gauge.name;
      if (gauge.name == input.device) return;  // checked by the gauge itself
    }
    for (const ModbusUnit& unit : bench_.modbus) {
      known += ", " + unit.name;
      if (unit.name != input.device) continue;
      const auto& registers = unit.map.registers;
      const auto found =
          std::find_if(registers.begin(), registers.end(), [&](const ModbusRegister& entry) {
            return entry.name == input.input && entry.role == RegisterRole::reading;
          });
      if (found == registers.end()) {
        std::string names;
        for (const ModbusRegister& entry : registers) {
          if (entry.role == RegisterRole::reading)
            names += (names.empty() ? "" : ", ") + entry.name;
        }
        document_.report(path + ".from", "the map " + unit.map_file.string() +
                                             " has no reading named \"" + input.input +
                                             "\"; its readings are " + names);
      }
      return;
    }
    document_.report(path + ".from", "there is no device \"" + input.device +
                                         "\" on this bench; its devices are " + known);
  }

  void check_rate(double inputs) {
    const double most = samples_per_s();
    if (inputs * rig_.loop.rate_hz > most) {
      document_.report("loop.rate_hz", "is too fast for " + short_of(inputs) + " inputs of " +
                                           board_ + ": expected at most " +
                                           short_of(std::floor(most / inputs)) + " Hz");
    }
  }

  double samples_per_s() const {
    switch (bench_.board) {
      case BoardKind::labjack_u6:
        return u6_samples_per_s;
      case BoardKind::labjack_t7:
        return t7_samples_per_s;
      case BoardKind::usb_1208fs_plus:
        break;
    }
    return usb_1208fs_samples_per_s;
  }

  void check_packet(double inputs) {
    if (bench_.board != BoardKind::labjack_t7 || !bench_.labjack_t7.scans_per_packet) return;
    const double most = std::floor(t7_samples_per_packet / inputs);
    if (*bench_.labjack_t7.scans_per_packet <= most) return;
    document_.report("labjack_t7.scans_per_packet",
                     "is " + std::to_string(*bench_.labjack_t7.scans_per_packet) +
                         ": a packet has 512 samples at most, so with " + short_of(inputs) +
                         " inputs expected " + short_of(most) + " or less");
  }

  void check_lines() {
    std::map<int, std::string> used;
    const LabjackOutput& board = output_ != nullptr ? *output_ : no_output_;
    const std::array<std::pair<const char*, std::optional<int>>, 3> lines = {{
        {".enable_line", board.enable_line},
        {".amplifier_fault_line", board.amplifier_fault_line},
        {".emergency_stop_line", board.emergency_stop_line},
    }};
    for (const auto& [key, line] : lines) {
      if (!line) continue;
      const auto [other, first] = used.emplace(*line, board_ + key);
      if (!first) document_.report(board_ + key, "is already the line of " + other->second);
    }
    const bool enable = board.enable_line || (bench_.amplifier && bench_.amplifier->enable);
    if (!enable) {
      document_.report("driver.bench.board",
                       "no line enables the amplifier, and an output at rest is not a safe state: "
                       "expected [amplifier.enable]" +
                           (labjack_ ? " or " + board_ + ".enable_line" : ""));
    }
  }

  /// Some device must disable the amplifier by itself if the daemon is killed: a GPIO chip may keep
  /// driving a line that no process holds.
  void check_dead_daemon() {
    const LabjackOutput& board = output_ != nullptr ? *output_ : no_output_;
    if (board.has_watchdog() || (bench_.amplifier && bench_.amplifier->heartbeat)) return;
    const bool has_line = board.enable_line || bench_.amplifier;
    if (!has_line) return;  // already reported
    document_.report(bench_.amplifier ? "amplifier" : board_ + ".watchdog_s",
                     "nothing disables the amplifier if the daemon is killed: expected "
                     "[amplifier.heartbeat] with a watchdog relay" +
                         (labjack_ ? ", or " + board_ + ".enable_line with a watchdog_s above 0"
                                   : std::string()));
  }

  void check_shaker() {
    const ShakerOutput& shaker = bench_.shaker;
    if (shaker.volts_per_unit == 0.0) {
      document_.report("shaker.volts_per_unit", "is 0: the shaker would never move");
      return;
    }
    if (shaker.low_v >= shaker.high_v || shaker.rest_v < shaker.low_v ||
        shaker.rest_v > shaker.high_v) {
      document_.report("shaker.rest_v", "is not between low_v and high_v");
      return;
    }
    const bool force = rig_.model.oscillator.excitation == physics::Excitation::force;
    const double most = force ? rig_.limits.force_n : rig_.limits.displacement_m;
    const double swing = std::abs(shaker.volts_per_unit) * most;
    const double margin = std::min(shaker.rest_v - shaker.low_v, shaker.high_v - shaker.rest_v);
    if (swing > margin * (1.0 + 1.0e-9)) {
      const char* path = force ? "limits.force_n" : "limits.displacement_m";
      document_.report(path, "takes " + short_of(swing) +
                                 " V on either side of shaker.rest_v, but "
                                 "only " +
                                 short_of(margin) + " V are available: expected " +
                                 short_of(margin / std::abs(shaker.volts_per_unit)) + " or less");
    }
  }

  /// A disturbed reply is ordinary on a line beside a power amplifier, and must not stop the rig.
  void warn_of_losses() {
    const double limit_s = rig_.safety.stale_after_s;
    for (const LongestAge& each : ages_after_a_lost_reply(bench_)) {
      if (limit_s <= 0.0 || each.age_s <= limit_s) continue;
      const std::string needed = short_of(std::ceil(100.0 * each.age_s) / 100.0);
      std::string text = "one lost reply stops the rig: the last reading of \"" + each.device;
      text += "\" is then up to " + needed + " s old, and safety.stale_after_s is ";
      text += short_of(limit_s) + ". Expected safety.stale_after_s = " + needed + " or more, or ";
      document_.warn(each.path, text + each.remedy);
    }
    for (std::size_t i = 0; i < bench_.modbus.size(); ++i) {
      if (bench_.modbus[i].retries > 0) continue;
      document_.warn("modbus." + std::to_string(i) + ".retries",
                     "is 0: one lost reply is the loss of \"" + bench_.modbus[i].name +
                         "\", which stops the rig. Expected 1 or more");
    }
  }

  Document& document_;
  const Rig& rig_;
  const Bench& bench_;
  std::string board_;
  const LabjackOutput* output_;  // null: the board has no lines
  const LabjackOutput no_output_;
  bool labjack_;
  std::set<std::string> names_;
  std::map<std::string, std::string> taken_;  // stem of the channel by DEVICE/INPUT
};

}  // namespace

void complete_bench(Document& document, Rig& rig) {
  Bench& bench = rig.bench;
  check_form(document, bench.inputs);
  check_form(document, bench.readback);
  bench.readback.longest_overrun_s =
      rig.safety.longest_overrun_s.value_or(bench.readback.longest_overrun_s);
  bench.labjack_u6.rest_v = bench.shaker.rest_v;
  bench.labjack_t7.rest_v = bench.shaker.rest_v;
  bench.usb_1208fs_plus.rest_v = bench.shaker.rest_v;
  for (std::size_t i = 0; i < bench.modbus.size(); ++i) read_map(document, i, bench.modbus[i]);
}

void check_bench(Document& document, const Rig& rig) { Checker(document, rig).check(); }

void refuse_bench(Document& document) {
  for (const char* table :
       {"inputs", "labjack_u6", "labjack_t7", "usb_1208fs_plus", "modbus", "gauge", "readback"}) {
    if (document.has(table)) {
      document.report(table, "is for driver.kind = \"bench\" only: remove it");
    }
  }
}

}  // namespace stickslip::config
