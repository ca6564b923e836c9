// What travels between a host and a PhidgetBridge 4-Input 1046 (not 1046_1): settings out, readings
// in, as pure functions of bytes. The layout is that of the maker's own open library of that time.
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

/// Firmware as bcdDevice says it: 102 is 1.02. Others than these speak another protocol (1046_1).
inline constexpr int first_firmware = 100;
inline constexpr int last_firmware = 199;
/// Before this one a change of gain needs input 0 enabled for a while.
inline constexpr int firmware_without_gain_bug = 102;
/// bcdDevice: two digits before the point and two behind it.
constexpr int firmware_of(std::uint16_t bcd_device) {
  const auto two_digits = [](unsigned bcd) {
    return static_cast<int>((bcd >> 4U) * 10 + (bcd & 0xFU));
  };
  return two_digits(bcd_device >> 8U) * 100 + two_digits(bcd_device & 0xFFU);
}

/// All that can be set.
struct Settings {
  std::array<bool, input_count> enabled{};
  std::array<int, input_count> gain = {1, 1, 1, 1};  ///< 1, 8, 16, 32, 64 or 128
  int interval_ms = 8;                               ///< 8 to 1000, a multiple of 8; of all inputs

  friend bool operator==(const Settings&, const Settings&) = default;
};

bool is_gain(int gain);
bool is_interval(int interval_ms);

inline constexpr std::size_t output_bytes = 5;
/// The settings as a report. Here the interval's low byte comes first; the board's own reports have
/// it last.
std::array<std::uint8_t, output_bytes> output_report(const Settings& settings);

inline constexpr std::size_t input_bytes = 18;

/// A report of the board.
struct InputReport {
  Settings settings;                             ///< as the board says that it has them
  std::array<bool, input_count> measured{};      ///< holds a reading
  std::array<bool, input_count> error{};         ///< the board says that it is out of range
  std::array<std::uint32_t, input_count> raw{};  ///< 24 bits, 0x800000 is 0
};

/// Nothing where it is too short, or says a gain or an interval that does not exist.
std::optional<InputReport> parse_input(std::span<const std::uint8_t> bytes);

/// Of a raw reading, at that gain [V/V].
double ratio(std::uint32_t raw, int gain);

/// Enabled, measured, without error, and within 0.995 of the range: beyond it the amplifier is at
/// its end.
bool believable(const InputReport& report, std::size_t input);

/// The bytes of an output report by the device's report descriptor, without an ID; 0: it has none
/// or the descriptor is malformed.
std::size_t output_report_bytes(std::span<const std::uint8_t> descriptor);

/// The settings on their way into the board: which report to send, and from when on its readings
/// are those of the settings.
class Handshake {
 public:
  Handshake(const Settings& wanted, int firmware);

  /// What is to be sent, if anything.
  std::optional<std::array<std::uint8_t, output_bytes>> to_send();
  /// Takes a report of the board.
  void take(const InputReport& report);
  /// Whether the last report that was taken may be believed.
  bool done() const { return phase_ == Phase::done; }
  /// Whether that input's reading in it may be: the first since the echo may be of a converter that
  /// had not settled. Reports without a reading of it do not count.
  bool settled(std::size_t input) const { return done() && readings_[input] >= 2; }
  /// Begins anew.
  void begin();
  /// Sends once more what was not echoed: it may have been lost on its way.
  void repeat() { send_ = send_ || phase_ == Phase::echo || phase_ == Phase::last_echo; }

 private:
  enum class Phase { echo, gain_bug, last_echo, first_sample, done };
  /// At the shortest interval: whether it is 250 ms or 32 reports that the bug takes, it is over.
  static constexpr int reports_of_gain_bug = 32;
  void send(const Settings& settings);

  Settings wanted_;
  Settings sent_;
  bool gain_bug_;
  Phase phase_ = Phase::echo;
  int reports_ = 0;
  std::array<int, input_count> readings_{};  // since the echo, no more than two
  bool send_ = false;
};

/// Counts reports that should have come. They may come late, by up to half an interval, and in
/// bunches; never early. The board's crystal is followed.
class GapCounter {
 public:
  explicit GapCounter(std::int64_t interval_ns) : interval_ns_(interval_ns) {}

  /// `reports` were there at `time_ns`, and no more: how many are missing before them.
  std::uint64_t take(std::int64_t time_ns, std::uint64_t reports);
  void restart() { begun_ = false; }

 private:
  std::int64_t interval_ns_;
  bool begun_ = false;
  double due_ns_ = 0.0;  // of the last report, had it come at once; relative to the origin
  std::int64_t origin_ns_ = 0;
};

}  // namespace stickslip::drivers::phidget_bridge
