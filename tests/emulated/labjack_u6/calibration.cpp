// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/labjack_u6/calibration.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace stickslip::emulated {

namespace {

constexpr double fixed_point = 4294967296.0;

std::int64_t to_fixed(double value) { return std::llround(value * fixed_point); }

double stored(double value) { return static_cast<double>(to_fixed(value)) / fixed_point; }

using Random = std::mt19937_64;

double around(Random& random, double nominal, double spread) {
  return stored(nominal + std::normal_distribution<double>(0.0, spread)(random));
}

U6ConverterCalibration converter(Random& random) {
  U6ConverterCalibration adc;
  double scale = 1.0;
  for (std::size_t gain = 0; gain < 4; ++gain, scale *= 0.1) {
    const double slope = 3.1580578e-4 * scale;
    adc.positive_slope[gain] = around(random, slope, 2e-3 * slope);
    adc.center[gain] = around(random, 33523.0, 20.0);
    adc.positive_offset[gain] = stored(-adc.positive_slope[gain] * adc.center[gain]);
    adc.negative_slope[gain] = around(random, -slope, 2e-3 * slope);
  }
  return adc;
}

std::array<double, 16> constants(const U6ConverterCalibration& adc) {
  std::array<double, 16> out{};
  for (std::size_t gain = 0; gain < 4; ++gain) {
    out[2 * gain] = adc.positive_slope[gain];
    out[2 * gain + 1] = adc.positive_offset[gain];
    out[8 + 2 * gain] = adc.negative_slope[gain];
    out[9 + 2 * gain] = adc.center[gain];
  }
  return out;
}

void append(Bytes& bytes, double value) {
  const auto fixed = static_cast<std::uint64_t>(to_fixed(value));
  for (unsigned shift = 0; shift < 64; shift += 8) {
    bytes.push_back(static_cast<std::uint8_t>(fixed >> shift));
  }
}

}  // namespace

U6Calibration u6_calibration_of_unit(std::uint64_t seed) {
  Random random(seed ^ 0xCA11B7A7EULL);
  U6Calibration unit;
  unit.adc = converter(random);
  unit.high_resolution_adc = converter(random);
  for (std::size_t dac = 0; dac < 2; ++dac) {
    unit.dac_slope[dac] = around(random, 13200.0, 40.0);
    unit.dac_offset[dac] = around(random, 0.0, 30.0);
  }
  unit.current_a = {around(random, 10e-6, 2e-8), around(random, 200e-6, 4e-7)};
  unit.temperature_slope = around(random, -92.379, 0.2);
  unit.temperature_offset = around(random, 465.129, 0.5);
  return unit;
}

Bytes u6_calibration_block(const U6Calibration& unit, std::size_t block, bool pro) {
  if (block >= 6 && !pro) return Bytes(32, 0xFF);
  Bytes bytes;
  if (block < 4 || block >= 6) {
    const auto all = constants(block < 4 ? unit.adc : unit.high_resolution_adc);
    const std::size_t first = 4 * (block < 4 ? block : block - 6);
    for (std::size_t i = first; i < first + 4; ++i) append(bytes, all[i]);
  } else if (block == 4) {
    for (std::size_t dac = 0; dac < 2; ++dac) {
      append(bytes, unit.dac_slope[dac]);
      append(bytes, unit.dac_offset[dac]);
    }
  } else {
    append(bytes, unit.current_a[0]);
    append(bytes, unit.current_a[1]);
    append(bytes, unit.temperature_slope);
    append(bytes, unit.temperature_offset);
  }
  return bytes;
}

double u6_counts(const U6ConverterCalibration& adc, int gain_index, double volts) {
  const auto gain = static_cast<std::size_t>(gain_index);
  return volts < 0.0 ? adc.center[gain] - volts / adc.negative_slope[gain]
                     : adc.center[gain] + volts / adc.positive_slope[gain];
}

double u6_dac_volts(const U6Calibration& unit, int dac, std::uint16_t counts) {
  const auto which = static_cast<std::size_t>(dac);
  const double effective = static_cast<double>(counts & 0xFFF0);
  return std::clamp((effective - unit.dac_offset[which]) / unit.dac_slope[which], 0.02, 4.95);
}

}  // namespace stickslip::emulated
