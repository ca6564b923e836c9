// SPDX-License-Identifier: Apache-2.0
#include "tools/calibration/significance.h"

#include <cmath>
#include <unsupported/Eigen/SpecialFunctions>

namespace stickslip::calibration {

double chi_squared_beyond(double chi2, double degrees_of_freedom) {
  return Eigen::numext::igammac(0.5 * degrees_of_freedom, 0.5 * chi2);
}

double normal_beyond(double z) { return std::erfc(std::abs(z) / std::sqrt(2.0)); }

double student_beyond(double t, double degrees_of_freedom) {
  if (!(std::abs(t) < 1.0e100)) return 0.0;
  return Eigen::numext::betainc(0.5 * degrees_of_freedom, 0.5,
                                degrees_of_freedom / (degrees_of_freedom + t * t));
}

double student_coverage_95(double degrees_of_freedom) {
  double low = 1.0;
  double high = 20.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (student_beyond(middle, degrees_of_freedom) > 0.05 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace stickslip::calibration
