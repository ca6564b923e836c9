// How improbable a statistic is where only chance is at work.
#pragma once

namespace stickslip::calibration {

/// Probability that chi-squared with so many degrees of freedom (above 0) exceeds `chi2` (0 or
/// more).
double chi_squared_beyond(double chi2, double degrees_of_freedom);

/// Probability that a normal deviate, in standard deviations, is further from 0 than `z`.
double normal_beyond(double z);

/// The same for Student's t with so many degrees of freedom (above 0).
double student_beyond(double t, double degrees_of_freedom);

/// How many standard deviations to either side hold 95 % where the standard deviation was itself
/// estimated with so many degrees of freedom (1 or more): 12.7 for one, towards 1.96 for many.
double student_coverage_95(double degrees_of_freedom);

}  // namespace stickslip::calibration
