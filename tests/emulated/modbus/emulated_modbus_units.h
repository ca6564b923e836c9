// SPDX-License-Identifier: Apache-2.0
// Emulated Modbus units on a serial line (a pseudo-terminal) and a TCP port, with faults of such
// lines. Written from the protocol specification, not from the driver.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "tests/emulated/usb_device.h"
#include "tests/emulated/wires.h"

namespace stickslip::emulated {

/// Numbered like the functions that read them.
enum class Table { coils = 1, discrete_inputs = 2, holding = 3, input = 4 };

enum class Kind { bit, u16, i16, u32, i32, i64, f32, f64, bcd16, bcd32 };

/// Bytes of a number of a kind in transmission order ("ABCD", "CDAB", "BADC", "DCBA").
Bytes bytes_of(Kind kind, const std::string& order, double number);

/// CRC-16 of serial messages; transmitted low byte first.
std::uint16_t checksum_of(const Bytes& message);

/// A number in a unit.
struct Parameter {
  Table table = Table::holding;
  int address = 0;
  Kind kind = Kind::u16;
  std::string order = "ABCD";
  /// Value at a time. Absent: the last written value, initially 0.
  std::function<double(std::int64_t time_ns)> number;
  bool locked = false;  ///< a write is confirmed without effect
};

/// A parameter that follows a sensor: raw = reading / resolution.
Parameter measured(Parameter parameter, Sensor sensor, Wires& wires, double resolution = 1.0);

struct UnitRules {
  std::vector<int> functions{1, 2, 3, 4, 5, 6, 15, 16};
  bool whole_parameters_only = false;  ///< partial reads are rejected (exception 2)
  bool pairs_only = false;             ///< reads of exactly two registers
  bool gaps_are_readable = true;       ///< unused addresses read as 0
  int float_mirror = 0;                ///< offset of float copies of all parameters; 0: none
};

/// Solartron's conditioner: functions 03, 04, 06, 16; float copies at an offset of 8000.
UnitRules orbit_rules();
/// Mantracourt's unit: holding registers in pairs only.
UnitRules dsc_rules();

enum class LineFault {
  none,
  late,
  silent,
  wrong_checksum,     ///< TCP: a wrong length in the header
  wrong_unit,         ///< reply of another unit
  wrong_transaction,  ///< serial: a wrong function
  short_frame,
  extra_bytes,
  exception_busy,
  repeated,
  torn,   ///< in parts, some milliseconds apart
  closed  ///< TCP: closed connection; serial: silence
};

/// Random faults of replies.
struct Weather {
  double probability = 0.0;
  std::vector<LineFault> faults;
  std::int64_t late_ns = 0;
};

class EmulatedModbusUnits {
 public:
  /// `folder` receives a link `line` to the serial line, which is constant over unplugging.
  EmulatedModbusUnits(Now now, std::filesystem::path folder, std::uint32_t seed);
  ~EmulatedModbusUnits();
  EmulatedModbusUnits(const EmulatedModbusUnits&) = delete;
  EmulatedModbusUnits& operator=(const EmulatedModbusUnits&) = delete;

  /// Before start.
  void add(int unit, UnitRules rules, std::vector<Parameter> parameters);
  void start();

  std::string serial_port() const { return (folder_ / "line").string(); }
  std::string tcp_port() const { return "127.0.0.1:" + std::to_string(port_); }

  // From any thread.
  void weather(int unit, Weather weather);
  /// Faults of the next replies of a unit, in order, before any random ones.
  /// `late_ns`: delay of a late reply.
  void next(int unit, LineFault fault, std::int64_t late_ns = 0);
  void dead(int unit, bool is_dead);
  void refuse(int unit, std::uint8_t exception);  ///< all requests; 0: none
  void unplug();
  void plug_in();
  void close_connections();
  std::uint64_t requests(int unit) const;  ///< received
  std::uint64_t writes(int unit) const;    ///< received write requests
  std::uint64_t faults() const;            ///< of replies
  /// Malformed requests: a wrong checksum, an unknown format.
  std::uint64_t nonsense() const;
  double written(int unit, Table table, int address) const;  ///< the first word

 private:
  struct Unit {
    UnitRules rules;
    std::vector<Parameter> parameters;
    std::map<std::pair<int, int>, Bytes> store;  // by table and address
    Weather weather;
    std::deque<std::pair<LineFault, std::int64_t>> next;
    bool dead = false;
    std::uint8_t refusal = 0;
    std::uint64_t requests = 0;
    std::uint64_t writes = 0;
  };
  /// A serial line or a TCP connection.
  struct Line {
    int file = -1;
    bool tcp = false;
    Bytes received;
  };
  struct Due {
    std::int64_t time_ns = 0;
    int file = -1;
    Bytes bytes;
  };

  void run();
  void serve_lines();
  void accept_connection();
  bool take(Line& line);
  bool take_serial(Line& line);
  bool take_tcp(Line& line);
  bool handle(Line& line, int transaction, const Bytes& message);
  Bytes answer(Unit& unit, const Bytes& message);
  Bytes read_bits(Unit& unit, Table table, int address, int count);
  Bytes read_registers(Unit& unit, Table table, int address, int count);
  Bytes write(Unit& unit, const Bytes& message);
  bool deliver(Line& line, int transaction, Bytes message, Unit& unit);
  LineFault drawn(Unit& unit, std::int64_t& late_ns);
  void send(int file, const Bytes& bytes, std::int64_t at_ns);
  void send_due();
  void close_line(Line& line);
  void open_terminal();
  Bytes content(Unit& unit, const Parameter& parameter);

  Now now_;
  std::filesystem::path folder_;
  mutable std::mutex mutex_;
  std::mt19937 random_;
  std::map<int, Unit> units_;
  std::deque<Line> lines_;
  std::vector<Due> due_;
  int listener_ = -1;
  int port_ = 0;
  int slave_ = -1;
  std::uint64_t faults_ = 0;
  std::uint64_t nonsense_ = 0;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace stickslip::emulated
