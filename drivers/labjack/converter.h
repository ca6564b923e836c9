// SPDX-License-Identifier: Apache-2.0
// The converter of the LabJack U6 and T7: both have the same inputs, ranges and nominal constants
// (U6 datasheet, section 5.4; T-series datasheet, sections 14.3.0 and 20.0.1).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "config/bench.h"

namespace stickslip::drivers::labjack {

inline constexpr int gain_count = 4;
inline constexpr int analog_inputs = 14;

/// Calibration constants of the inputs, by gain.
struct ConverterCalibration {
  std::array<double, gain_count> positive_slope_v{};  ///< [V/count]
  std::array<double, gain_count> negative_slope_v{};  ///< [V/count], negative
  std::array<double, gain_count> center{};            ///< [count] at 0 V
};

/// Nominal constants; every board is close to them.
ConverterCalibration nominal_converter();
/// The first implausible constant, with its value and the nominal one; empty if there is none.
std::string implausible_constant(const ConverterCalibration& calibration);
/// "the center of gain 2 is 0 (nominal: 33523)"; `index` is that of a gain or DAC.
std::string implausible(const std::string& what, int index, double value, double nominal);
/// True if the value is finite and that close to the nominal one.
bool within(double value, double nominal, double tolerance);

/// Voltage of a count of the stream's converter, at that gain (0 to 3).
double volts(const ConverterCalibration& calibration, std::uint8_t gain, std::uint16_t counts);

/// "AIN0" to "AIN13".
std::optional<std::uint8_t> input_named(const std::string& name);
/// The gain with the range +-range_v, if there is one: 0: 10 V, 1: 1 V, 2: 0.1 V, 3: 0.01 V.
std::optional<std::uint8_t> gain_of(double range_v);

/// The first error of an input, or empty. `table` is that in the configuration, `board` its name
/// there.
std::string input_error(const std::string& table, const std::string& board,
                        const config::BenchInput& input);
/// "labjack_u6.dac = 2: must be 0 to 1", or empty.
std::string range_error(const std::string& key, int value, int low, int high);

}  // namespace stickslip::drivers::labjack
