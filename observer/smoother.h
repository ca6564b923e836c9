// SPDX-License-Identifier: Apache-2.0
// Smoothed estimates of a recording: the observer's filter forwards, and backwards an information
// filter of all later readings. (The gains of a
// Rauch-Tung-Striebel smoother would invert the sensor chains, which are stable forwards, so it
// would be unstable.)
#pragma once

#include <functional>
#include <span>

#include "observer/observer.h"

namespace stickslip::observer {

/// Quality of the one-step predictions of a model.
struct PredictionQuality {
  /// Negative log-likelihood of all readings that were used, from the filter's one-step
  /// predictions; densities are in the units of the channels.
  double negative_log_likelihood = 0.0;
  long readings = 0;
  long refused = 0;               ///< outliers, not in the sum
  std::uint64_t restarts = 0;     ///< of the filter
  double normalised_squares = 0;  ///< sum of the NIS; about `readings` for a consistent model
};

struct SmoothingWindow {
  double keep_s = 10.0;   ///< smoothed at a time
  double ahead_s = 10.0;  ///< additional later readings that are used
};

/// Smooths `frames` (SI units, in order of time) and calls `take` with one estimate for each frame
/// whose time advances, in order. States, sticking and covariance of the estimate are smoothed, the
/// rest is the filter's. No information is carried across a reinitialisation of the filter. First
/// the filter alone, whose quality is returned; then the first 10 s, smoothed repeatedly until
/// their parameters stay; then all of it, linearised about these. Each smoothing is two: the second
/// linearised about the states of the first. Steps of at most 0.25 ms. Memory does not grow with
/// the recording. `progress`, unless empty, is called with the completed share of the work, 0 to 1.
/// Throws std::invalid_argument as FrictionObserver does, and where the model
/// is not supported, with the reason.
PredictionQuality smooth(const physics::Model& model, double period_s,
                         std::span<const Frame> frames,
                         const std::function<void(const FrictionEstimate&)>& take,
                         const SmoothingWindow& window = {},
                         const std::function<void(double share)>& progress = {});

}  // namespace stickslip::observer
