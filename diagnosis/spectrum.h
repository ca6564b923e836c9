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
/// harmonic; its phase counts from the first sample.
std::optional<physics::Line> mains_of(const std::vector<double>& values, double period_s);

/// The values without that line, if there is one.
std::vector<double> without_mains(std::vector<double> values, double period_s);

}  // namespace stickslip::diagnosis
