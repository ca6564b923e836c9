// SPDX-License-Identifier: Apache-2.0
// Noiseless simulations of the true rig, their sizes, and the visibility of a change of the rig.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "tools/concealment/bench_drawing.h"
#include "tools/concealment/hidden_effect.h"
#include "tools/concealment/reference_simulator.h"

namespace stickslip::concealment {

/// Readings without noise, the states behind them, and copies of the simulator at the starts of the
/// windows in which differences between rigs are evaluated.
struct NoiselessRun {
  std::vector<std::array<double, channel_count>> readings;
  std::vector<physics::RigTruth> truth;  ///< at the end of the simulator's step
  std::vector<ReferenceSimulator> window_starts;
  double slip_share = 0.0;
};

/// A run sampled at these times [s], which increase from 0 or later.
NoiselessRun simulate(const ReferenceRig& rig, std::span<const double> times_s, bool with_windows);

/// True if all readings are finite, the displacement is within 60 mm, and a forced rig with
/// friction slips at least a tenth of the time.
bool is_plausible(const NoiselessRun& run, const ReferenceRig& rig);

/// Fills everything but the duration.
void measure(const NoiselessRun& run, Sizes& sizes);

/// Differences of the readings of `other` from those of `rig` over the noise, by window from equal
/// initial states, in one column.
Eigen::VectorXd difference(const NoiselessRun& run, const ReferenceRig& rig,
                           const ReferenceRig& other, double sample_rate_hz);

double root_mean_square(const Eigen::VectorXd& values);

}  // namespace stickslip::concealment
