// SPDX-License-Identifier: Apache-2.0
#include "tools/commissioning/sine_fit.h"

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

namespace stickslip::commissioning {

Sine sine_of(std::span<const double> time_s, std::span<const double> value, double frequency_hz) {
  const auto n = static_cast<Eigen::Index>(time_s.size());
  Eigen::MatrixXd basis(n, 3);
  Eigen::VectorXd readings(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double angle = 2.0 * std::numbers::pi * frequency_hz * time_s[at];
    basis.row(i) << 1.0, std::sin(angle), std::cos(angle);
    readings(i) = value[at];
  }
  const Eigen::Vector3d fit = basis.colPivHouseholderQr().solve(readings);
  const double residual = (readings - basis * fit).squaredNorm();
  const double variance = n > 3 ? residual / static_cast<double>(n - 3) : 0.0;
  return {fit(0), std::hypot(fit(1), fit(2)), std::atan2(fit(2), fit(1)),
          std::sqrt(2.0 * variance / static_cast<double>(n))};
}

}  // namespace stickslip::commissioning
