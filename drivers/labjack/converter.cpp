// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack/converter.h"

#include <cmath>
#include <cstdio>

#include "physics/number_text.h"

namespace stickslip::drivers::labjack {

ConverterCalibration nominal_converter() {
  ConverterCalibration nominal;
  double scale = 1.0;
  for (std::size_t gain = 0; gain < gain_count; ++gain) {
    nominal.positive_slope_v[gain] = 3.1580578e-4 * scale;
    nominal.negative_slope_v[gain] = -3.1580580e-4 * scale;
    nominal.center[gain] = 33523.0;
    scale /= 10.0;
  }
  return nominal;
}

bool within(double value, double nominal, double tolerance) {
  return std::abs(value - nominal) <= tolerance;  // false for NaN
}

std::string implausible(const std::string& what, int index, double value, double nominal) {
  char text[160];
  std::snprintf(text, sizeof text, "%s %d is %.6g, nominal is %.6g", what.c_str(), index, value,
                nominal);
  return text;
}

std::string implausible_constant(const ConverterCalibration& calibration) {
  const ConverterCalibration nominal = nominal_converter();
  for (std::size_t gain = 0; gain < gain_count; ++gain) {
    const int index = static_cast<int>(gain);
    const double positive = nominal.positive_slope_v[gain];
    const double negative = nominal.negative_slope_v[gain];
    if (!within(calibration.positive_slope_v[gain], positive, 0.05 * positive)) {
      return implausible("the slope for positive volts of gain", index,
                         calibration.positive_slope_v[gain], positive);
    }
    if (!within(calibration.negative_slope_v[gain], negative, -0.05 * negative)) {
      return implausible("the slope for negative volts of gain", index,
                         calibration.negative_slope_v[gain], negative);
    }
    if (!within(calibration.center[gain], nominal.center[gain], 2000.0)) {
      return implausible("the center of gain", index, calibration.center[gain],
                         nominal.center[gain]);
    }
  }
  return {};
}

double volts(const ConverterCalibration& calibration, std::uint8_t gain, std::uint16_t counts) {
  const double above = counts - calibration.center[gain];
  return above < 0.0 ? -above * calibration.negative_slope_v[gain]
                     : above * calibration.positive_slope_v[gain];
}

std::optional<std::uint8_t> input_named(const std::string& name) {
  for (int input = 0; input < analog_inputs; ++input) {
    if (name == "AIN" + std::to_string(input)) return static_cast<std::uint8_t>(input);
  }
  return std::nullopt;
}

std::optional<std::uint8_t> gain_of(double range_v) {
  constexpr double ranges_v[gain_count] = {10.0, 1.0, 0.1, 0.01};
  for (std::uint8_t gain = 0; gain < gain_count; ++gain) {
    if (within(range_v, ranges_v[gain], 1e-9)) return gain;
  }
  return std::nullopt;
}

std::string input_error(const std::string& table, const std::string& board,
                        const config::BenchInput& input) {
  const std::string where = table + " = " + board + "/" + input.input + ": ";
  const auto place = input_named(input.input);
  if (!place) return where + "the board's inputs are AIN0 to AIN13";
  if (input.differential && *place % 2 != 0) {
    return where + "a differential pair begins with an even input (AIN0 against AIN1)";
  }
  if (!gain_of(input.range_v)) {
    return where + "range_v = " + physics::number_text(input.range_v, 9) +
           ": must be 10, 1, 0.1 or 0.01";
  }
  return {};
}

std::string range_error(const std::string& key, int value, int low, int high) {
  if (value >= low && value <= high) return {};
  return key + " = " + std::to_string(value) + ": must be " + std::to_string(low) + " to " +
         std::to_string(high);
}

}  // namespace stickslip::drivers::labjack
