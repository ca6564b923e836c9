// SPDX-License-Identifier: Apache-2.0
// Seeded runs of simulated rigs with known truth, and the errors of a friction estimator on them.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "config/rig.h"
#include "observer/observer.h"
#include "physics/frame.h"
#include "physics/model.h"
#include "physics/simulator.h"

namespace stickslip::runs {

inline constexpr double period_s = 1.0e-3;  ///< sampling period

/// A rig, its frames, and the models given to an estimator.
struct Run {
  std::vector<Frame> frames;             ///< one per period
  std::vector<physics::RigTruth> truth;  ///< at the times of the frames
  physics::Model real;
  physics::Model assumed;       ///< off by up to 20 %
  physics::Model assumed_half;  ///< mu and gamma 50 % off
};

/// `preset` with parameters drawn from their distributions and mu and gamma up to 20 % off, driven
/// for `seconds` by its own excitation with a random amplitude modulation; integrated in steps of
/// 20 us.
Run run_of(const config::Rig& preset, std::uint64_t seed, double seconds);

/// The assumed model with the true parameters, for the best accuracy an estimator can reach.
physics::Model with_true_parameters(const Run& run);

/// Root-mean-square errors of an estimator, in the units of the quantities.
struct Errors {
  double theta = 0.0, force = 0.0;
  double raw = 0.0;  ///< of Eq. (1), friction force; 0 where no frame had a force channel
  double theta_std = 0.0, force_std = 0.0;  ///< its own standard deviations
  double nees = 0.0;             ///< of x, v, theta and mu at the end; four degrees of freedom
  double mean_nees = 0.0;        ///< per degree of freedom
  double nis = 0.0;              ///< per degree of freedom
  double mu = 0.0, gamma = 0.0;  ///< at the end, relative
  double classified = 0.0;  ///< share of stick and slip classified correctly, away from transitions
  std::uint64_t restarts = 0;
};

/// Processes a frame and returns the estimate at its time; the reference is valid until the next.
using Estimator = std::function<const observer::FrictionEstimate&(const Frame&)>;

/// Errors of an estimator with the model `assumed` on a run, from `from_s` on.
Errors evaluate(const Run& run, const physics::Model& assumed, double from_s,
                const Estimator& estimator);

/// Degrees of freedom of a NEES: x, v, theta and mu, which every model with friction has.
inline constexpr int nees_states = 4;

/// NEES of an estimate of a rig with friction; infinite where its covariance is not positive.
double nees_of(const observer::FrictionEstimate& estimate, const physics::RigTruth& truth,
               double mu);

/// Quantile of `values`, which must not be empty.
double quantile(std::vector<double> values, double share);

/// True if a NEES of four degrees of freedom is within its 95 % bounds.
bool inside_bounds(double nees);

}  // namespace stickslip::runs
