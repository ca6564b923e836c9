// SPDX-License-Identifier: Apache-2.0
// calibration.toml: conversion of each channel's raw readings to SI, with its reference, its
// uncertainty, and the calibrations before it.
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
  double reference_si = 0.0;     ///< reference value
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
/// reading less the crosstalk from other channels. The default is the identity: raw is SI.
struct ChannelCalibration {
  double offset = 0.0;  ///< [raw]
  double gain = 1.0;    ///< [SI/raw]
  /// By channel: crosstalk of its SI value into this reading [SI of this / SI of that].
  std::array<double, channel_count> crosstalk{};
  LineCovariance covariance{};             ///< all 0: known exactly, or unknown
  double residual_std = 0.0;               ///< of the points about the line, SI
  std::optional<ValidRange> valid{};       ///< in SI: range of the calibration; absent: unlimited
  std::string raw_unit{};                  ///< of the readings: "V/V", "counts"; empty: unknown
  std::string date{};                      ///< ISO 8601; empty: unknown
  std::string reference{};                 ///< "weights set 12, class M1"
  std::string by{};                        ///< person who calibrated
  std::vector<std::string> despite{};      ///< failed checks of the fit that were overridden
  std::vector<CalibrationPoint> points{};  ///< in the order of measurement

  friend bool operator==(const ChannelCalibration&, const ChannelCalibration&) = default;
};

using ChannelCalibrations = std::array<ChannelCalibration, channel_count>;

/// Previous calibration of a channel.
struct FormerCalibration {
  Channel channel = Channel::displacement;
  ChannelCalibration calibration;

  friend bool operator==(const FormerCalibration&, const FormerCalibration&) = default;
};

/// A whole, consistent calibration file.
struct CalibrationFile {
  std::array<std::optional<ChannelCalibration>, channel_count> channel{};
  std::vector<FormerCalibration> history;  ///< newest first for each channel

  friend bool operator==(const CalibrationFile&, const CalibrationFile&) = default;
};

/// Reads a calibration file. Throws InputError with every problem found, each with file, line,
/// column.
CalibrationFile load_calibration(const std::filesystem::path& file);

/// The same for text in memory; messages name the file as `name`.
CalibrationFile parse_calibration(std::string_view text, const std::string& name);

/// The calibration as a file; parse_calibration reads it back to an equal one (numbers to the bit).
std::string calibration_text(const CalibrationFile& file);

/// Replaces the calibration of a channel; the previous one becomes the first of its history. The
/// new one inherits its crosstalk if it has none. Throws InputError, naming `name`, if the new one
/// is older than the previous one.
void renew(CalibrationFile& file, Channel channel, ChannelCalibration calibration,
           const std::string& name);

/// Standard uncertainty of the reading `si` due to offset and gain, SI, without the scatter of a
/// single reading.
double calibration_sigma(const ChannelCalibration& calibration, double si);

/// Determinant of (1 + crosstalk): 1 without crosstalk, near 0 for indistinguishable channels.
double crosstalk_determinant(const ChannelCalibrations& calibrations);

/// Seconds since 1970-01-01 UTC of "2026-11-22" (its midnight), "2026-11-22T14:03:00Z" or
/// "2026-11-22T14:03:00+01:00"; empty for any other text.
std::optional<std::int64_t> utc_seconds(std::string_view iso_8601);

}  // namespace stickslip::config
