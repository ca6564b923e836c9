// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/fourier.h"

#include <unsupported/Eigen/FFT>

namespace stickslip::diagnosis {

std::vector<std::complex<double>> fourier(const std::vector<double>& samples) {
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> spectrum;
  transform.fwd(spectrum, samples);
  return spectrum;
}

std::vector<std::complex<double>> inverse_fourier(
    const std::vector<std::complex<double>>& spectrum) {
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> samples;
  transform.inv(samples, spectrum);
  return samples;
}

}  // namespace stickslip::diagnosis
