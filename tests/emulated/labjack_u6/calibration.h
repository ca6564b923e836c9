// SPDX-License-Identifier: Apache-2.0
// Calibration constants in the flash of an emulated U6, and its conversion of volts. The
// electronics follow the stored constants, so that a driver that applies them recovers the volts to
// within resolution and noise.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "tests/emulated/usb_device.h"

namespace stickslip::emulated {

/// Constants of one converter, by gain index 0 (+-10 V) to 3 (+-0.01 V).
struct U6ConverterCalibration {
  std::array<double, 4> positive_slope{};   ///< [V/count], at or above the centre
  std::array<double, 4> positive_offset{};  ///< [V], of the line through the positive side
  std::array<double, 4> negative_slope{};   ///< [V/count], negative, below the centre
  std::array<double, 4> center{};           ///< [counts], at 0 V
};

struct U6Calibration {
  U6ConverterCalibration adc;
  U6ConverterCalibration high_resolution_adc;  ///< of the U6-Pro
  std::array<double, 2> dac_slope{};           ///< [counts/V]
  std::array<double, 2> dac_offset{};          ///< [counts]
  std::array<double, 2> current_a{};           ///< of the two current sources
  double temperature_slope = 0.0;              ///< [K/V]
  double temperature_offset = 0.0;             ///< [K]
};

inline constexpr std::size_t u6_calibration_blocks = 10;

/// Constants of a random unit: close to the nominal values, and rounded to 32.32 fixed point.
U6Calibration u6_calibration_of_unit(std::uint64_t seed);

/// Block 0 to 9 of the calibration memory, 32 bytes. Blocks 6 to 9 are erased (FF) unless `pro`.
Bytes u6_calibration_block(const U6Calibration& calibration, std::size_t block, bool pro);

/// Counts of the converter at a voltage, without noise, rounding and limits.
double u6_counts(const U6ConverterCalibration& adc, int gain_index, double volts);

/// Output voltage at those counts [V]: 12 effective bits, 0.02 to 4.95 V.
double u6_dac_volts(const U6Calibration& calibration, int dac, std::uint16_t counts);

}  // namespace stickslip::emulated
