// SPDX-License-Identifier: Apache-2.0
// Protocol of the PhidgetBridge 4-Input 1046 (not 1046_1): settings and readings as pure functions
// of bytes. The layout is that of the manufacturer's open library of that time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace stickslip::drivers::phidget_bridge {

inline constexpr std::uint16_t vendor_id = 0x06C2;
inline constexpr std::uint16_t product_id = 0x003B;
inline constexpr std::size_t input_count = 4;

/// Firmware versions by bcdDevice: 102 is 1.02. Others use a different protocol (1046_1).
inline constexpr int first_firmware = 100;
inline constexpr int last_firmware = 199;
/// Earlier versions apply a change of gain only with input 0 enabled for a while.
inline constexpr int firmware_without_gain_bug = 102;
/// As in the manufacturer's libraries: bcdDevice is not decimal but two numbers, before the point
/// and behind it; one below 0x100 is that before the point. None for 0, which stands for no
/// release.
constexpr std::optional<int> firmware_of(std::uint16_t bcd_device) {
  if (bcd_device == 0) return std::nullopt;
  if (bcd_device < 0x100) return bcd_device * 100;
  return (bcd_device >> 8) * 100 + (bcd_device & 0xFF);
}

/// Settings of the board.
struct Settings {
  std::array<bool, input_count> enabled{};
  std::array<int, input_count> gain = {1, 1, 1, 1};  ///< 1, 8, 16, 32, 64 or 128
  int interval_ms = 8;                               ///< 8 to 1000, a multiple of 8; for all inputs

  friend bool operator==(const Settings&, const Settings&) = default;
};

bool is_gain(int gain);
bool is_interval(int interval_ms);

inline constexpr std::size_t output_bytes = 5;
/// Encodes the settings. The interval is little-endian here, big-endian in the board's reports.
std::array<std::uint8_t, output_bytes> output_report(const Settings& settings);

inline constexpr std::size_t input_bytes = 18;

/// Report of the board.
struct InputReport {
  Settings settings;                             ///< as stated by the board; any interval_ms
  std::array<bool, input_count> measured{};      ///< contains a reading
  std::array<bool, input_count> error{};         ///< reported as out of range
  std::array<std::uint32_t, input_count> raw{};  ///< 24 bits, 0x800000 is 0
};

/// None if it is too short or contains an invalid gain.
std::optional<InputReport> parse_input(std::span<const std::uint8_t> bytes);

/// Bridge ratio of a raw reading at a gain [V/V].
double ratio(std::uint32_t raw, int gain);

/// True for an enabled, measured input without error within 0.995 of the range; beyond it the
/// amplifier saturates.
bool is_valid(const InputReport& report, std::size_t input);

/// Length of an output report by the report descriptor, without an ID; 0: none, or a malformed
/// descriptor.
std::size_t output_report_bytes(std::span<const std::uint8_t> descriptor);

/// Transfer of the settings to the board: the reports to send, and the time from which readings are
/// taken with these settings. The board confirms inputs and gains by repeating them. What it states
/// as the interval is not compared: whether its firmware repeats the requested one is not
/// published.
class Handshake {
 public:
  Handshake(const Settings& wanted, int firmware);

  /// The report to send, if any.
  std::optional<std::array<std::uint8_t, output_bytes>> to_send();
  /// Processes a report of the board.
  void take(const InputReport& report);
  /// True if the latest report is valid.
  bool done() const { return phase_ == Phase::done; }
  /// True if the reading of that input in it is valid: the first after the echo may be that of a
  /// converter that had not settled. Reports without a reading of the input do not count.
  bool settled(std::size_t input) const { return done() && readings_[input] >= 2; }
  /// Restarts the transfer.
  void begin();
  /// Repeats a report that was not echoed, as it may have been lost.
  void repeat() { send_ = send_ || phase_ == Phase::echo || phase_ == Phase::last_echo; }

 private:
  enum class Phase { echo, gain_bug, last_echo, first_sample, done };
  /// At the shortest interval this covers both 250 ms and 32 reports, whichever the bug needs.
  static constexpr int reports_of_gain_bug = 32;
  void send(const Settings& settings);

  Settings wanted_;
  Settings sent_;
  bool gain_bug_;
  Phase phase_ = Phase::echo;
  int reports_ = 0;
  std::array<int, input_count> readings_{};  // since the echo, at most two
  bool send_ = false;
};

/// Counts missing reports. Reports may be late by up to half an interval, and arrive in bursts, but
/// are never early. Tracks the board's crystal.
class GapCounter {
 public:
  explicit GapCounter(std::int64_t interval_ns) : interval_ns_(interval_ns) {}

  /// Number of reports missing before the `reports` that have arrived by `time_ns`.
  std::uint64_t count(std::int64_t time_ns, std::uint64_t reports);
  void restart() { started_ = false; }

 private:
  std::int64_t interval_ns_;
  bool started_ = false;
  double due_ns_ = 0.0;  // nominal time of the last report, relative to the origin
  std::int64_t origin_ns_ = 0;
};

}  // namespace stickslip::drivers::phidget_bridge
