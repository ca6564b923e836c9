// SPDX-License-Identifier: Apache-2.0
// Gain of a change of the readings once everything else that is free has adapted to it: window
// states, calibrated parameters, knots of the drive's error. To first order in these, by one
// Jacobian.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <span>
#include <vector>

#include "diagnosis/hypothesis.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// Change of the scaled readings, by window.
using Change = std::vector<Eigen::VectorXd>;

/// Where a fit stands: what changes of its readings are compared with.
class NuisanceProjection {
 public:
  /// `windows`: derivatives of the hypothesis at `z`.
  NuisanceProjection(const Hypothesis& hypothesis, std::span<const double> z,
                     std::vector<WindowJacobian> windows);

  const Eigen::VectorXd& residual(std::size_t w) const { return windows_[w].residual; }
  double samples() const;

  /// product(a, a) is the increase of chi-squared by the change.
  double product(const Change& a, const Change& b) const;

  /// Half the derivative of the cost, priors included, along the change: below 0 where the change
  /// explains part of the residuals.
  double slope(const Change& change) const;

 private:
  std::vector<WindowJacobian> windows_;
  std::vector<Eigen::LLT<Eigen::MatrixXd>> own_;
  std::vector<Eigen::MatrixXd> cross_;
  Eigen::LDLT<Eigen::MatrixXd> common_;
  Change unabsorbed_;  // residuals that nothing free absorbs
};

/// Change of the readings by an effect that `with` adds to the hypothesis `base`, fitted to the
/// task with these unknowns and states; `projection` is of that fit.
Change change_by(const Hypothesis& with, const Task& task, const FittedHypothesis& base,
                 const NuisanceProjection& projection);

}  // namespace stickslip::diagnosis
