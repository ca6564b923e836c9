// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/design/drive.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stickslip::design {

double second_derivative(const Drive& drive, std::size_t k) {
  const std::vector<double>& u = drive.samples;
  if (k == 0 || k + 1 >= u.size()) return 0.0;
  return (u[k + 1] - 2.0 * u[k] + u[k - 1]) / (drive.period_s * drive.period_s);
}

DrivePeaks peaks_of(const Drive& drive) {
  DrivePeaks out;
  const std::vector<double>& u = drive.samples;
  for (std::size_t k = 0; k < u.size(); ++k) {
    out.value = std::max(out.value, std::abs(u[k]));
    if (k > 0) out.first = std::max(out.first, std::abs(u[k] - u[k - 1]) / drive.period_s);
    out.second = std::max(out.second, std::abs(second_derivative(drive, k)));
  }
  return out;
}

double factor_within(const DrivePeaks& peaks, const DriveLimits& limits) {
  double out = std::numeric_limits<double>::infinity();
  const auto bound = [&out](double peak, double limit) {
    if (peak > 0.0) out = std::min(out, limit / peak);
  };
  bound(peaks.value, limits.value);
  bound(peaks.first, limits.first);
  bound(peaks.second, limits.second);
  return out;
}

Drive scaled(Drive drive, double factor) {
  for (double& each : drive.samples) each *= factor;
  return drive;
}

}  // namespace stickslip::design
