// SPDX-License-Identifier: Apache-2.0
// Encoding of commands to a LabJack U6 and decoding of its replies: pure functions, without USB.
// The layouts are those of the board's low-level function reference (U6 datasheet, section 5.2).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>

#include "drivers/labjack/converter.h"
#include "drivers/labjack/scan_layout.h"

namespace stickslip::drivers::labjack_u6 {

inline constexpr std::uint16_t vendor_id = 0x0CD5;
inline constexpr std::uint16_t product_id = 0x0006;
/// Limit of commands, replies and stream packets: the endpoints take 64 bytes.
inline constexpr std::size_t largest_packet = 64;
using labjack::analog_inputs;
using labjack::gain_count;
using labjack::gain_of;
using labjack::input_named;
using labjack::StreamChannel;
using labjack::volts;
inline constexpr int digital_lines = 20;  ///< FIO0-7, EIO0-7, CIO0-3
/// The watchdog encodes its line in four bits.
inline constexpr int watchdog_lines = 16;
/// Over all channels [samples/s].
inline constexpr double highest_sample_rate_hz = 50000.0;

/// Sum of the bytes, its carries added back in twice.
std::uint8_t checksum8(std::span<const std::uint8_t> bytes);
/// Sum of the bytes modulo 65536.
std::uint16_t checksum16(std::span<const std::uint8_t> bytes);

/// One transfer to the command endpoint.
struct Command {
  std::array<std::uint8_t, largest_packet> bytes{};
  std::size_t size = 0;
  std::span<const std::uint8_t> view() const { return {bytes.data(), size}; }
};

/// Requests the identity of the board.
Command request_identity();
/// Requests a block of the calibration memory, 0 to 9. Not while streaming.
Command request_calibration(int block);
/// Makes all lines plain digital ones: no timers, no counters.
Command plain_lines();
Command start_stream();
Command stop_stream();
/// The board sets that line (0 to 15) low if it receives nothing for `timeout_s`.
Command arm_watchdog(std::uint16_t timeout_s, int line);
Command disarm_watchdog();

/// Scan clock: `hz` / `interval` scans per second.
struct ScanClock {
  std::uint32_t hz = 0;
  std::uint16_t interval = 1;
  std::uint8_t config_bits = 0;  ///< of StreamConfig's byte 11

  double rate_hz() const { return static_cast<double>(hz) / interval; }
  /// Time from the start of the stream to the start of a scan, exact to the nanosecond.
  std::int64_t time_ns(std::uint64_t scan) const;
};

/// The clock and interval with the nearest rate (positive and finite); of equal ones the fastest
/// clock.
ScanClock nearest_clock(double rate_hz);
/// |rate of the clock / rate - 1|
double deviation(const ScanClock& clock, double rate_hz);

/// 1 to 25 channels, `samples_per_packet` 1 to 25.
Command configure_stream(std::span<const StreamChannel> channels, int resolution_index,
                         int samples_per_packet, int settling, const ScanClock& clock);

/// Several operations in one command, executed in order. Operations that exceed the command are
/// dropped; those that this driver combines fit.
class Feedback {
 public:
  /// The reply repeats `echo`.
  explicit Feedback(std::uint8_t echo);
  Feedback& dac(int dac, std::uint16_t counts);
  /// Makes the line an output.
  Feedback& set_line(int line, bool high);
  Feedback& make_input(int line);
  /// At most once per command: the reply then holds the levels of all lines.
  Feedback& read_lines();
  Command command() const;

 private:
  void add(std::initializer_list<std::uint8_t> bytes);
  Command command_;
};

/// Result of checking a reply.
struct Verdict {
  enum class Kind : std::uint8_t {
    ok,
    length,    ///< not the length of this command's reply
    checksum,  ///< corrupted in transit
    refused,   ///< the board found the command's checksum wrong (B8 B8)
    command,   ///< the reply to something else
    error,     ///< reported by the board: `code`
  };
  Kind kind = Kind::ok;
  std::uint8_t code = 0;      ///< error code of the board
  std::uint8_t position = 0;  ///< Feedback: the failed operation, from 1

  explicit operator bool() const { return kind == Kind::ok; }
};

/// In one word, and back; the position is dropped.
constexpr std::uint32_t packed(const Verdict& verdict) {
  return static_cast<std::uint32_t>(verdict.kind) | static_cast<std::uint32_t>(verdict.code) << 8U;
}
constexpr Verdict unpacked(std::uint32_t word) {
  return {static_cast<Verdict::Kind>(word & 0xFFU), static_cast<std::uint8_t>(word >> 8U & 0xFFU)};
}

/// Name of an error code of the board; "unknown error" for others.
const char* error_name(std::uint8_t code);
/// For messages, without the name of the board: "error 55 (scan overlap)".
std::string in_words(const Verdict& verdict);

/// Reply to ConfigU6.
struct Identity {
  std::uint32_t serial = 0;
  std::uint16_t product = 0;
  std::uint8_t firmware_major = 0;
  std::uint8_t firmware_minor = 0;
  bool pro = false;
};
Verdict parse_identity(std::span<const std::uint8_t> reply, Identity& identity);
/// "LabJack U6-Pro #360009876"
std::string name_of(const Identity& identity);
/// "1.43"
std::string firmware_of(const Identity& identity);

using CalibrationBlock = std::array<std::uint8_t, 32>;
Verdict parse_calibration(std::span<const std::uint8_t> reply, CalibrationBlock& block);
Verdict check_plain_lines(std::span<const std::uint8_t> reply);
Verdict check_stream_configured(std::span<const std::uint8_t> reply);
Verdict check_stream_started(std::span<const std::uint8_t> reply);
/// "The stream is not running" (52) is an error here too.
Verdict check_stream_stopped(std::span<const std::uint8_t> reply);
Verdict check_watchdog(std::span<const std::uint8_t> reply);

/// The reply to a Feedback.
struct FeedbackReply {
  std::uint8_t echo = 0;
  std::uint32_t lines = 0;  ///< bit i: line i is high; 0 if not requested
};
/// `echo` is set even with an error of the board.
Verdict parse_feedback(std::span<const std::uint8_t> reply, bool lines_read, FeedbackReply& out);

/// Calibration constants of one board.
struct Calibration : labjack::ConverterCalibration {
  std::array<double, 2> dac_slope{};   ///< [count/V]
  std::array<double, 2> dac_offset{};  ///< [count]
};

/// Nominal constants; every board is close to them.
Calibration nominal_calibration();
/// From blocks 0 to 4 (the others hold current sources, the thermometer and the slow converter of
/// the Pro, none of which a stream uses).
inline constexpr int calibration_blocks = 5;
Calibration calibration_of(std::span<const CalibrationBlock, calibration_blocks> blocks);
/// The first implausible constant, with its value and the nominal one; empty if there is none.
std::string implausible_constant(const Calibration& calibration);

/// The nearest count of the DAC; 0 V for a voltage that is not finite.
std::uint16_t dac_counts(const Calibration& calibration, int dac, double volts);

}  // namespace stickslip::drivers::labjack_u6
