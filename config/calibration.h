// calibration.toml: how each channel's raw readings become SI, against what that was found, how
// sure it is, and what held before.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "physics/frame.h"

namespace stickslip::config {

/// One reading of a known value.
struct CalibrationPoint {
  double raw = 0.0;              ///< mean reading, in the device's unit
  double raw_std = 0.0;          ///< standard deviation of that mean; 0: unknown
  double reference_si = 0.0;     ///< what the channel was made to measure
  double reference_sigma = 0.0;  ///< its standard uncertainty, SI; 0: known exactly

  friend bool operator==(const CalibrationPoint&, const CalibrationPoint&) = default;
};

/// Covariance of a straight line's offset and gain.
struct LineCovariance {
  double offset = 0.0;       ///< variance of the offset [raw^2]
  double offset_gain = 0.0;  ///< covariance of offset and gain [SI]
  double gain = 0.0;         ///< variance of the gain [(SI/raw)^2]

  friend bool operator==(const LineCovariance&, const LineCovariance&) = default;
};

struct ValidRange {
  double low = 0.0;
  double high = 0.0;

  friend bool operator==(const ValidRange&, const ValidRange&) = default;
};

/// reading = (raw - offset) * gain, with raw in the driver's unit; the channel's value is the
/// reading without what leaks into it from other channels. The default is the identity: raw is SI.
struct ChannelCalibration {
  double offset = 0.0;  ///< [raw]
  double gain = 1.0;    ///< [SI/raw]
  /// By channel: how much of its SI value leaks into this reading [SI of this / SI of that].
  std::array<double, channel_count> crosstalk{};
  LineCovariance covariance{};             ///< all 0: known exactly, or nobody knows
  double residual_std = 0.0;               ///< of the points about the line, SI
  std::optional<ValidRange> valid{};       ///< in SI: where it was looked at; absent: anywhere
  std::string raw_unit{};                  ///< of the readings: "V/V", "counts"; empty: not told
  std::string date{};                      ///< ISO 8601; empty: not told
  std::string reference{};                 ///< against what: "weights set 12, class M1"
  std::string by{};                        ///< who did it
  std::vector<std::string> despite{};      ///< what spoke against it when somebody insisted
  std::vector<CalibrationPoint> points{};  ///< in the order in which they were taken

  friend bool operator==(const ChannelCalibration&, const ChannelCalibration&) = default;
};

using ChannelCalibrations = std::array<ChannelCalibration, channel_count>;

/// What a channel's calibration was before.
struct FormerCalibration {
  Channel channel = Channel::displacement;
  ChannelCalibration calibration;

  friend bool operator==(const FormerCalibration&, const FormerCalibration&) = default;
};

/// A whole calibration file, sound in itself.
struct CalibrationFile {
  std::array<std::optional<ChannelCalibration>, channel_count> channel{};
  std::vector<FormerCalibration> history;  ///< of each channel the newest first

  friend bool operator==(const CalibrationFile&, const CalibrationFile&) = default;
};

/// Reads a calibration file. Throws InputError with every problem that was found, each with file,
/// line and column.
CalibrationFile load_calibration(const std::filesystem::path& file);

/// The same for text in memory; `name` stands for the file in messages.
CalibrationFile parse_calibration(std::string_view text, const std::string& name);

/// The calibration as a file; parse_calibration reads it back to an equal one (numbers to the bit).
std::string calibration_text(const CalibrationFile& file);

/// Gives the channel a new calibration; the one that it had becomes the first of its history, but
/// for its cross-talk, which the new one inherits where it has none of its own. Throws InputError,
/// naming `name`, where the new one is older than the one that it replaces.
void renew(CalibrationFile& file, Channel channel, ChannelCalibration calibration,
           const std::string& name);

/// Standard uncertainty of the reading `si` by that of offset and gain, SI. The scatter of a single
/// reading comes on top.
double calibration_sigma(const ChannelCalibration& calibration, double si);

/// Determinant of (1 + cross-talk): 1 without any, towards 0 where channels cannot be told apart.
double crosstalk_determinant(const ChannelCalibrations& calibrations);

/// Seconds since 1970-01-01 UTC of "2026-11-22" (its midnight), "2026-11-22T14:03:00Z" or
/// "2026-11-22T14:03:00+01:00"; nothing where the text is none of these.
std::optional<std::int64_t> utc_seconds(std::string_view iso_8601);

}  // namespace stickslip::config
