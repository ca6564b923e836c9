// SPDX-License-Identifier: Apache-2.0
// Tail probabilities of test statistics.
#pragma once

namespace stickslip::calibration {

/// Probability that chi-squared with this many degrees of freedom (> 0) exceeds `chi2` (>= 0).
double chi_squared_beyond(double chi2, double degrees_of_freedom);

/// Two-sided tail probability of a standard normal deviate.
double normal_beyond(double z);

/// The same for Student's t with this many degrees of freedom (> 0).
double student_beyond(double t, double degrees_of_freedom);

/// Coverage factor of a 95 % interval whose standard deviation was estimated with this many degrees
/// of freedom (>= 1): 12.7 for one, towards 1.96 for many.
double student_coverage_95(double degrees_of_freedom);

}  // namespace stickslip::calibration
