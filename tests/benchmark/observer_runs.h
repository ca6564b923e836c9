// Seeded runs of simulated rigs whose truth is known, and how right an estimator of friction was on
// one: for the programs that judge estimators.
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

inline constexpr double period_s = 1.0e-3;  ///< of the frames

/// One rig as it was, what its sensors said, and what an estimator is told of it.
struct Run {
  std::vector<Frame> frames;             ///< one a period
  std::vector<physics::RigTruth> truth;  ///< at the times of the frames
  physics::Model real;
  physics::Model believed;       ///< off by up to 20 %
  physics::Model believed_half;  ///< mu and gamma 50 % off
};

/// `preset` with its parameters drawn from their doubt and mu and gamma up to 20 % off, driven by
/// its own excitation, amplitude-modulated as by hand, for `seconds`; integrated in steps of 20 us.
Run run_of(const config::Rig& preset, std::uint64_t seed, double seconds);

/// What the runs believe, but the rig's own numbers: for how well an estimator can do at best.
physics::Model knowing(const Run& run);

/// How far an estimator was off; root mean squares in the quantities' units.
struct Errors {
  double theta = 0.0, force = 0.0;
  double raw = 0.0;  ///< of Eq. (1), friction force; 0 where no frame had a force channel
  double theta_doubt = 0.0, force_doubt = 0.0;  ///< deviations that it stated itself
  double nees = 0.0;             ///< of x, v, theta and mu at the end; four degrees of freedom
  double mean_nees = 0.0;        ///< per degree of freedom
  double nis = 0.0;              ///< per degree of freedom
  double mu = 0.0, gamma = 0.0;  ///< at the end, relative
  double classified = 0.0;       ///< share of stick and slip told rightly, away from transitions
  std::uint64_t restarts = 0;
};

/// Takes a frame and says what is known at its time; the reference holds until the next one.
using Estimator = std::function<const observer::FrictionEstimate&(const Frame&)>;

/// Lets an estimator that believes `believed` watch a run, and judges it from `from_s` on.
Errors watch(const Run& run, const physics::Model& believed, double from_s,
             const Estimator& estimator);

/// The value below which a share of the values lies. `values` must not be empty.
double quantile(std::vector<double> values, double share);

/// Whether a normalised error squared of four degrees of freedom is within its 95 % bounds.
bool inside_bounds(double nees);

}  // namespace stickslip::runs
