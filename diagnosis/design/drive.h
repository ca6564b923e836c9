// SPDX-License-Identifier: Apache-2.0
// The signal of a run, sampled: base displacement or force from rest to rest, with its largest
// derivatives.
#pragma once

#include <vector>

namespace stickslip::design {

/// A drive in uniform samples [m] or [N]; it begins and ends at rest at 0.
struct Drive {
  double period_s = 0.002;
  std::vector<double> samples;

  double duration_s() const { return period_s * static_cast<double>(samples.size()); }
};

/// Largest magnitudes of a drive and of its derivatives by time.
struct DrivePeaks {
  double value = 0.0;   ///< [m] or [N]
  double first = 0.0;   ///< [m/s] or [N/s]
  double second = 0.0;  ///< [m/s^2]
};

DrivePeaks peaks_of(const Drive& drive);

/// Limits of the drive; infinite where there is none.
struct DriveLimits {
  double value = 0.0;
  double first = 0.0;
  double second = 0.0;
};

/// Largest factor on the drive with which no limit is exceeded; infinite for a drive at rest.
double factor_within(const DrivePeaks& peaks, const DriveLimits& limits);

Drive scaled(Drive drive, double factor);

/// Second derivative at a sample, by central differences; 0 at the ends.
double second_derivative(const Drive& drive, std::size_t sample);

}  // namespace stickslip::design
