// SPDX-License-Identifier: Apache-2.0
// Estimates of one number by several recordings: the value or the line that fits them all, whether
// it is tenable, the recordings that disagree with it, and the spread of what varies.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace stickslip::diagnosis {

/// One estimate by recording. They are correlated where they rest on the same common numbers.
struct OwnEstimates {
  Eigen::VectorXd value;
  Eigen::MatrixXd covariance;
};

/// Generalised least squares of the estimates: value = design coefficient.
struct Heterogeneity {
  Eigen::VectorXd coefficient;
  Eigen::MatrixXd covariance;  ///< of the coefficients
  double q = 0.0;              ///< Cochran's: the weighted sum of squares that is left
  int freedom = 0;
  double p = 1.0;  ///< probability of as much where the design holds in all recordings
  /// Recordings that have to be left out, the farthest first, for the rest to agree; all of them
  /// where no rest does.
  std::vector<std::size_t> disagreeing;
};

/// `level`: probability below which the estimates do not agree; a recording is judged at its share
/// of it (Bonferroni).
Heterogeneity heterogeneity_of(const OwnEstimates& estimates, const Eigen::MatrixXd& design,
                               double level);

/// A column of ones: the same value in all recordings.
Eigen::MatrixXd common_design(Eigen::Index recordings);

/// Values from a normal distribution.
struct Spread {
  double mean = 0.0;
  double mean_error = 0.0;  ///< standard error
  double value = 0.0;       ///< standard deviation of the values
  double low = 0.0;         ///< 95 % interval of it
  double high = 0.0;
};

/// Restricted maximum likelihood of the spread, with its profile's interval.
Spread spread_of(const OwnEstimates& estimates);

}  // namespace stickslip::diagnosis
