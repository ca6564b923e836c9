// The spectrum of a whole channel, and what the mains puts into it.
#pragma once

#include <complex>
#include <optional>
#include <vector>

#include "physics/effects/effect.h"

namespace stickslip::diagnosis {

/// Of the values drawn out with zeros to a power of two, both halves.
std::vector<std::complex<double>> spectrum_of(std::vector<double> values);

/// From 0 Hz to half of the sampling rate, under a Hann window so that strong slow motion does not
/// leak; drawn out to a power of two: line i is at i / (2 size() period).
std::vector<std::complex<double>> windowed_spectrum(std::vector<double> values);

/// The strongest line at the frequency of the mains (50 or 60 Hz), or at twice or three times that,
/// if any stands out of its surroundings; its phase counts from the first sample.
std::optional<physics::Line> mains_of(const std::vector<double>& values, double period_s);

/// The values without that line, if there is one.
std::vector<double> without_mains(std::vector<double> values, double period_s);

}  // namespace stickslip::diagnosis
