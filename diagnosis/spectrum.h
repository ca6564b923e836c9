// SPDX-License-Identifier: Apache-2.0
// Spectrum of a whole channel, and its mains line.
#pragma once

#include <complex>
#include <optional>
#include <vector>

#include "physics/effect.h"

namespace stickslip::diagnosis {

/// Two-sided spectrum of the values, zero-padded to a power of two.
std::vector<std::complex<double>> spectrum_of(std::vector<double> values);

/// One-sided spectrum under a Hann window, which suppresses leakage of strong slow motion,
/// zero-padded to a power of two: line i is at i / (2 size() period).
std::vector<std::complex<double>> windowed_spectrum(std::vector<double> values);

/// The strongest significant line at the mains frequency (50 or 60 Hz) or its second or third
/// harmonic; its phase counts from the first sample. `lone`: only a line that towers above all
/// within 4 Hz, as none of a periodic motion does, but also one beyond half the sampling rate where
/// it appears, if that is far above the motion.
std::optional<physics::Line> mains_of(const std::vector<double>& values, double period_s,
                                      bool lone = false);

/// Deviation of the mains frequency from its nominal value in normal operation, as a share of it.
inline constexpr double mains_deviation = 0.004;

/// Where a frequency appears after sampling [Hz].
double apparent_hz(double frequency_hz, double period_s);

/// The mains frequency or harmonic that appears nearest to `frequency_hz` [Hz].
double mains_behind(double frequency_hz, double period_s);

/// Frequency of the strongest line of the values [Hz]; 0 for constant values.
double strongest_frequency_hz(const std::vector<double>& values, double period_s);

/// The values without that line, if there is one.
std::vector<double> without_mains(std::vector<double> values, double period_s);

}  // namespace stickslip::diagnosis
