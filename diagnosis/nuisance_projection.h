// SPDX-License-Identifier: Apache-2.0
// Gain of changes of the readings once everything else that is free has adapted to them: window
// states, calibrated parameters, knots of the drive's error. To first order in these, by one
// Jacobian.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <span>
#include <utility>
#include <vector>

#include "diagnosis/hypothesis.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// Change of the scaled readings, by window.
using Change = std::vector<Eigen::VectorXd>;

/// The best sizes of some changes, and how everything else that is free moves with them.
struct Response {
  Eigen::VectorXd size;               ///< of each change
  Eigen::VectorXd parameters;         ///< steps of the unknowns
  std::vector<Eigen::VectorXd> free;  ///< steps of the free numbers, by window
  double gain = 0.0;  ///< decrease of the cost, beyond what a step without the changes gains
};

/// Weights of windows in a fit: below 1 for outliers.
std::vector<double> robust_weights(const std::vector<WindowJacobian>& windows);

/// Where a fit stands: what changes of its readings are compared with.
class NuisanceProjection {
 public:
  /// How the normal equations depart from those of a plain Newton step.
  struct Options {
    std::vector<double> weight = {};  ///< of each window; empty: 1
    double damping = 0.0;             ///< of Levenberg and Marquardt, of everything
  };

  /// `windows`: derivatives of the hypothesis at `z`.
  NuisanceProjection(const Hypothesis& hypothesis, std::span<const double> z,
                     std::vector<WindowJacobian> windows)
      : NuisanceProjection(hypothesis, z, std::move(windows), {}) {}
  NuisanceProjection(const Hypothesis& hypothesis, std::span<const double> z,
                     std::vector<WindowJacobian> windows, Options options);

  const Eigen::VectorXd& residual(std::size_t w) const { return windows_[w].residual; }
  double samples() const;

  /// product(a, a) is the increase of chi-squared by the change.
  double product(const Change& a, const Change& b) const;

  /// Half the derivative of the cost, priors included, along the change: below 0 where the change
  /// explains part of the residuals.
  double slope(const Change& change) const;

  /// Changes that everything else imitates, or that are none, get the size 0.
  Response response_to(std::span<const Change> changes) const;

 private:
  // Of a change, or of several in columns: its part of the normal equations of the unknowns, what
  // the window's free numbers absorb taken off.
  struct Reduced {
    Eigen::MatrixXd own;       // of the free numbers
    Eigen::MatrixXd solved;    // their steps, with the sign changed
    Eigen::MatrixXd gradient;  // of the unknowns
  };
  Reduced reduced(std::size_t w, const Eigen::MatrixXd& changes) const;

  std::vector<WindowJacobian> windows_;
  std::vector<double> weight_;  // by window
  double damping_;
  std::vector<Eigen::LLT<Eigen::MatrixXd>> own_;
  std::vector<Eigen::MatrixXd> cross_;
  Eigen::LDLT<Eigen::MatrixXd> common_;
  Eigen::VectorXd step_;                   // of the unknowns without a change
  std::vector<Eigen::VectorXd> own_step_;  // of the free numbers
  Change unabsorbed_;                      // residuals after that step
};

/// Change of the readings by an effect that `with` adds to the hypothesis `base`, fitted to the
/// task with these unknowns and states; `projection` is of that fit.
Change change_by(const Hypothesis& with, const Task& task, const FittedHypothesis& base,
                 const NuisanceProjection& projection);

}  // namespace stickslip::diagnosis
