// SPDX-License-Identifier: Apache-2.0
// Discrete Fourier transforms. One translation unit holds the code of the transform: GCC 12 rounds
// an inlined copy of it differently from file to file, and results would depend on which copy the
// linker keeps.
#pragma once

#include <complex>
#include <vector>

namespace stickslip::diagnosis {

/// All coefficients of the transform of real samples, unscaled, as many as samples.
std::vector<std::complex<double>> fourier(const std::vector<double>& samples);

/// The samples of a spectrum: inverse of `fourier`, scaled by the number of coefficients.
std::vector<std::complex<double>> inverse_fourier(
    const std::vector<std::complex<double>>& spectrum);

}  // namespace stickslip::diagnosis
