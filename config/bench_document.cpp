#include "config/bench_document.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <set>
#include <string_view>

#include "config/key.h"
#include "physics/problem.h"

namespace stickslip::config {

namespace {

constexpr double u6_samples_per_s = 50'000.0;
constexpr double usb_1208fs_samples_per_s = 51'200.0;
constexpr int u6_inputs = 14;
constexpr int usb_1208fs_inputs = 8;
constexpr std::array u6_ranges_v = {10.0, 1.0, 0.1, 0.01};
constexpr std::array usb_1208fs_ranges_v = {20.0, 10.0, 5.0, 4.0, 2.5, 2.0, 1.25, 1.0};
constexpr std::array bridge_gains = {1, 8, 16, 32, 64, 128};
constexpr std::string_view bridge = "phidget_bridge";

std::string short_of(double value) {
  std::array<char, 32> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value,
                                 std::chars_format::general, 6);
  return {digits.data(), end.ptr};
}

std::string name_of(BoardKind board) {
  return std::string(choice_at(rig_keys(), "driver.bench.board", static_cast<std::size_t>(board)));
}

/// The number behind `prefix` in "AIN3", below `count`.
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

template <class Target, class Value>
void take(Target& target, const std::optional<Value>& value) {
  if (value) target = static_cast<Target>(*value);
}

class Reader {
 public:
  Reader(Document& document, const std::filesystem::path& folder)
      : document_(document), folder_(folder) {}

  Bench read() {
    Bench bench;
    take(bench.board, document_.choice("driver.bench.board"));
    read_inputs(bench.inputs);
    take(bench.shaker.volts_per_unit, document_.number("shaker.volts_per_unit"));
    take(bench.shaker.rest_v, document_.number("shaker.rest_v"));
    take(bench.shaker.low_v, document_.number("shaker.low_v"));
    take(bench.shaker.high_v, document_.number("shaker.high_v"));
    bench.labjack_u6.rest_v = bench.shaker.rest_v;
    bench.usb_1208fs_plus.rest_v = bench.shaker.rest_v;
    read_u6(bench.labjack_u6);
    take(bench.usb_1208fs_plus.serial, document_.text("usb_1208fs_plus.serial"));
    take(bench.usb_1208fs_plus.output, document_.integer("usb_1208fs_plus.output"));
    take(bench.usb_1208fs_plus.output_ahead_s, document_.number("usb_1208fs_plus.output_ahead_s"));
    bench.phidget_bridge.serial = serial("phidget_bridge.serial");
    take(bench.phidget_bridge.interval_ms, document_.integer("phidget_bridge.interval_ms"));
    read_units(bench.modbus);
    bench.gauges = document_.gauges();
    if (document_.has("amplifier")) read_amplifier(bench.amplifier.emplace());
    return bench;
  }

 private:
  std::optional<std::uint32_t> serial(std::string_view path) const {
    const auto number = document_.integer(path);
    if (!number) return std::nullopt;
    return static_cast<std::uint32_t>(*number);
  }

  void read_inputs(BenchInputs& inputs) {
    for (const Channel channel : all_channels) {
      const std::string path = "inputs." + std::string(info(channel).stem);
      if (!document_.has(path)) continue;
      const std::string from = document_.text(path + ".from").value_or("");
      const auto slash = from.find('/');
      if (slash == std::string::npos || slash == 0 || slash + 1 == from.size()) {
        document_.report(path + ".from",
                         (from.empty() ? std::string("is missing") : "is \"" + from + '"') +
                             ": expected DEVICE/INPUT, such as \"labjack_u6/AIN0\"");
        continue;
      }
      BenchInput& input = inputs[index_of(channel)].emplace();
      input.device = from.substr(0, slash);
      input.input = from.substr(slash + 1);
      take(input.range_v, document_.number(path + ".range_v"));
      take(input.differential, document_.boolean(path + ".differential"));
      take(input.gain, document_.integer(path + ".gain"));
    }
  }

  void read_u6(LabjackU6& u6) const {
    u6.serial = serial("labjack_u6.serial");
    take(u6.resolution_index, document_.integer("labjack_u6.resolution_index"));
    take(u6.settling, document_.integer("labjack_u6.settling"));
    take(u6.transfers, document_.integer("labjack_u6.transfers"));
    take(u6.dac, document_.integer("labjack_u6.dac"));
    const auto whole = [this](std::string_view path) -> std::optional<int> {
      const auto number = document_.integer(path);
      if (!number) return std::nullopt;
      return static_cast<int>(*number);
    };
    u6.samples_per_packet = whole("labjack_u6.samples_per_packet");
    u6.enable_line = whole("labjack_u6.enable_line");
    u6.amplifier_fault_line = whole("labjack_u6.amplifier_fault_line");
    u6.emergency_stop_line = whole("labjack_u6.emergency_stop_line");
    take(u6.watchdog_s, document_.integer("labjack_u6.watchdog_s"));
  }

  void read_units(std::vector<ModbusUnit>& units) {
    units = document_.modbus_units();
    for (std::size_t i = 0; i < units.size(); ++i) {
      ModbusUnit& unit = units[i];
      if (unit.map_file.is_relative()) {
        unit.map_file = (folder_ / unit.map_file).lexically_normal();
      }
      std::string text;
      try {
        text = read_text(unit.map_file);
      } catch (const InputError& error) {
        document_.report("modbus." + std::to_string(i) + ".map",
                         unit.map_file.string() + ": " + error.problems().front().message);
        continue;
      }
      try {
        unit.map = parse_modbus_map(text, unit.map_file.string());
      } catch (const InputError& error) {
        document_.add(error.problems());
      }
    }
  }

  std::optional<GpioLine> line(const std::string& path) const {
    if (!document_.has(path)) return std::nullopt;
    GpioLine line;
    take(line.line, document_.text(path + ".line"));
    take(line.active_low, document_.boolean(path + ".active_low"));
    take(line.bias, document_.choice(path + ".bias"));
    return line;
  }

  void read_amplifier(Amplifier& amplifier) const {
    take(amplifier.chip, document_.text("amplifier.chip"));
    amplifier.enable = line("amplifier.enable");
    amplifier.fault = line("amplifier.fault");
    amplifier.emergency_stop = line("amplifier.emergency_stop");
    amplifier.heartbeat = line("amplifier.heartbeat");
    if (amplifier.fault) {
      take(amplifier.fault->debounce_s, document_.number("amplifier.fault.debounce_s"));
    }
    if (amplifier.emergency_stop) {
      take(amplifier.emergency_stop->debounce_s,
           document_.number("amplifier.emergency_stop.debounce_s"));
    }
    take(amplifier.heartbeat_period_s, document_.number("amplifier.heartbeat_period_s"));
  }

  Document& document_;
  std::filesystem::path folder_;
};

class Checker {
 public:
  Checker(Document& document, const Rig& rig)
      : document_(document), rig_(rig), bench_(rig.bench), board_(name_of(rig.bench.board)) {}

  void check() {
    check_units();
    for (const Channel channel : all_channels) {
      if (bench_.inputs[index_of(channel)]) check_input(channel, *bench_.inputs[index_of(channel)]);
    }
    const BenchInputs on_board = inputs_of(bench_.inputs, board_);
    const auto count = std::count_if(on_board.begin(), on_board.end(),
                                     [](const auto& input) { return input.has_value(); });
    if (count == 0) {
      document_.report("inputs", "none of the channels comes from " + board_ +
                                     ", whose scans are the frames: expected one or more from \"" +
                                     board_ + "/...\"");
    }
    check_rate(static_cast<double>(count));
    check_lines();
    check_dead_daemon();
    check_shaker();
    if (bench_.phidget_bridge.interval_ms % 8 != 0) {
      document_.report("phidget_bridge.interval_ms",
                       "is no multiple of 8, which is the bridge's step");
    }
  }

 private:
  void check_name(const std::string& at, const std::string& name) {
    if (name.find('/') != std::string::npos || name == bridge || name == "labjack_u6" ||
        name == "usb_1208fs_plus") {
      document_.report(at, "\"" + name +
                               "\" cannot name a device: expected a name without '/' that is no "
                               "other device's");
    } else if (!names_.insert(name).second) {
      document_.report(at, "\"" + name + "\" names another device already");
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
        unit.parity != other.parity || unit.stop_bits != other.stop_bits) {
      document_.report(at + "port", "shares the bus of \"" + other.name +
                                        "\" with other settings: transport, baud, parity and "
                                        "stop_bits are the same for all units of a bus");
    }
    if (unit.unit == other.unit) {
      document_.report(at + "unit", "is that of \"" + other.name + "\" on the same bus");
    }
  }

  void check_input(Channel channel, const BenchInput& input) {
    const std::string path = "inputs." + std::string(info(channel).stem);
    const std::string from = input.device + "/" + input.input;
    const auto [taken, first] = taken_.emplace(from, info(channel).stem);
    if (!first) {
      document_.report(path + ".from", "\"" + from + "\" is that of " + taken->second + " already");
    }
    if (input.device == board_) {
      check_board_input(path, input);
    } else if (input.device == bridge) {
      check_bridge_input(path, input);
    } else {
      check_register(path, input);
    }
    useless(path, input.device == board_, {"range_v", "differential"}, "inputs of a board");
    useless(path, input.device == bridge, {"gain"}, "inputs of a bridge");
  }

  void useless(const std::string& path, bool used, std::initializer_list<const char*> names,
               const char* whose) {
    for (const char* name : names) {
      const std::string at = path + "." + name;
      if (!used && document_.has(at)) {
        document_.report(at, std::string("is for ") + whose + " only: remove it");
      }
    }
  }

  void check_board_input(const std::string& path, const BenchInput& input) {
    const bool u6 = bench_.board == BoardKind::labjack_u6;
    const int inputs = u6 ? u6_inputs : input.differential ? 4 : usb_1208fs_inputs;
    const char* prefix = u6 ? "AIN" : "CH";
    const auto number = numbered(input.input, prefix, inputs);
    if (!number || (u6 && input.differential && *number % 2 != 0)) {
      document_.report(path + ".from", "\"" + input.input + "\" is no " +
                                           (input.differential ? "differential " : "") +
                                           "input of " + board_ + ": expected " + prefix + "0 to " +
                                           prefix + std::to_string(inputs - 1) +
                                           (u6 && input.differential ? ", the even ones" : ""));
    }
    check_range(path, input, u6);
  }

  void check_range(const std::string& path, const BenchInput& input, bool u6) {
    std::vector<double> ranges(u6_ranges_v.begin(), u6_ranges_v.end());
    if (!u6) ranges.assign(usb_1208fs_ranges_v.begin(), usb_1208fs_ranges_v.end());
    if (!u6 && !input.differential) ranges = {10.0};
    if (std::find(ranges.begin(), ranges.end(), input.range_v) != ranges.end()) return;
    std::string list;
    for (const double range : ranges) list += (list.empty() ? "" : ", ") + short_of(range);
    document_.report(path + ".range_v", "is " + short_of(input.range_v) + " V, which " + board_ +
                                            " does not have for this input: expected " + list);
  }

  void check_bridge_input(const std::string& path, const BenchInput& input) {
    if (!numbered(input.input, "", 4)) {
      document_.report(path + ".from",
                       "\"" + input.input + "\" is no input of a bridge: expected 0, 1, 2 or 3");
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
      if (gauge.name == input.device) return;  // the gauge itself knows its inputs
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
                                             "\"; there are " + names);
      }
      return;
    }
    document_.report(path + ".from", "there is no device \"" + input.device +
                                         "\" on this bench; there are " + known);
  }

  void check_rate(double inputs) {
    const bool u6 = bench_.board == BoardKind::labjack_u6;
    const double most = u6 ? u6_samples_per_s : usb_1208fs_samples_per_s;
    if (inputs * rig_.loop.rate_hz > most) {
      document_.report("loop.rate_hz", "is too fast for " + short_of(inputs) + " inputs of " +
                                           board_ + ": expected at most " +
                                           short_of(std::floor(most / inputs)) + " Hz");
    }
  }

  void check_lines() {
    std::map<int, const char*> used;
    const LabjackU6& u6 = bench_.labjack_u6;
    const std::array<std::pair<const char*, std::optional<int>>, 3> lines = {{
        {"labjack_u6.enable_line", u6.enable_line},
        {"labjack_u6.amplifier_fault_line", u6.amplifier_fault_line},
        {"labjack_u6.emergency_stop_line", u6.emergency_stop_line},
    }};
    for (const auto& [path, line] : lines) {
      if (!line) continue;
      const auto [other, first] = used.emplace(*line, path);
      if (!first) document_.report(path, std::string("is the line of ") + other->second + " too");
    }
    const bool enable = u6.enable_line || (bench_.amplifier && bench_.amplifier->enable);
    if (!enable) {
      document_.report(
          "driver.bench.board",
          "no line tells the amplifier that it may be on, and an output at rest is no "
          "safe state: expected [amplifier.enable]" +
              std::string(bench_.board == BoardKind::labjack_u6 ? " or labjack_u6.enable_line"
                                                                : ""));
    }
  }

  /// Something has to let go of the amplifier by itself when the daemon dies: a GPIO chip may go on
  /// driving a line that nobody holds any more.
  void check_dead_daemon() {
    const bool u6 = bench_.labjack_u6.enable_line && bench_.labjack_u6.watchdog_s > 0;
    if (u6 || (bench_.amplifier && bench_.amplifier->heartbeat)) return;
    const bool has_line = bench_.labjack_u6.enable_line || bench_.amplifier;
    if (!has_line) return;  // told already
    document_.report(bench_.amplifier ? "amplifier" : "labjack_u6.watchdog_s",
                     "nothing lets go of the amplifier when the daemon dies: expected "
                     "[amplifier.heartbeat] with a watchdog relay" +
                         std::string(bench_.board == BoardKind::labjack_u6
                                         ? ", or labjack_u6.enable_line with a watchdog_s above 0"
                                         : ""));
  }

  void check_shaker() {
    const ShakerOutput& shaker = bench_.shaker;
    if (shaker.volts_per_unit == 0.0) {
      document_.report("shaker.volts_per_unit", "is 0, so that nothing would ever move");
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
    const double room = std::min(shaker.rest_v - shaker.low_v, shaker.high_v - shaker.rest_v);
    if (swing > room * (1.0 + 1.0e-9)) {
      const char* path = force ? "limits.force_n" : "limits.displacement_m";
      document_.report(path, "takes " + short_of(swing) +
                                 " V on either side of shaker.rest_v, and "
                                 "there are " +
                                 short_of(room) + " V: expected " +
                                 short_of(room / std::abs(shaker.volts_per_unit)) + " or less");
    }
  }

  Document& document_;
  const Rig& rig_;
  const Bench& bench_;
  std::string board_;
  std::set<std::string> names_;
  std::map<std::string, std::string> taken_;  // by DEVICE/INPUT: the channel's stem
};

}  // namespace

Bench read_bench(Document& document, const std::filesystem::path& folder) {
  return Reader(document, folder).read();
}

void check_bench(Document& document, const Rig& rig) { Checker(document, rig).check(); }

void refuse_bench(Document& document) {
  for (const char* table : {"inputs", "labjack_u6", "usb_1208fs_plus", "modbus", "gauge"}) {
    if (document.has(table)) {
      document.report(table, "is for driver.kind = \"bench\" only: remove it");
    }
  }
}

}  // namespace stickslip::config
