// Best estimates of a recording: what the observer says of each frame, with what came after it
// taken into account: the observer's own filter forwards, and what all later readings say of a
// state backwards, as an information filter. (A backward pass of gains, as Rauch, Tung and
// Striebel's, would undo the sensor chains, which forget; that grows without bound.)
#pragma once

#include <functional>
#include <span>

#include "observer/observer.h"

namespace stickslip::observer {

/// How well the model foretells the readings, one period ahead.
struct Foretelling {
  /// Negative log-likelihood of all readings that were used, by the filter's own prediction of
  /// each; densities are in the units of the channels.
  double negative_log_likelihood = 0.0;
  long readings = 0;
  long refused = 0;               ///< outliers, not in the sum
  std::uint64_t restarts = 0;     ///< of the filter
  double normalised_squares = 0;  ///< sum of the NIS; about `readings` where the model is right
};

struct SmoothingWindow {
  double keep_s = 10.0;   ///< smoothed at a time
  double ahead_s = 10.0;  ///< looked ahead beyond that
};

/// Smooths `frames` (SI units, in order of time) and hands on one estimate for each whose time
/// advances, in order. Its fields are those of the observer's estimate; states, sticking and
/// covariance are smoothed, what is said of the readings is the filter's. Where the filter began
/// anew nothing is carried across. The recording is gone through twice, the second time from the mu
/// and the gamma that were learnt in the first; what is returned is the first's. Memory does not
/// grow with the recording. `progress`, unless empty, is told the share of the work that is done, 0
/// to
/// 1. Throws std::invalid_argument as FrictionObserver does, and where the
/// observer cannot follow the model, with its reason.
Foretelling smooth(const physics::Model& model, double period_s, std::span<const Frame> frames,
                   const std::function<void(const FrictionEstimate&)>& take,
                   const SmoothingWindow& window = {},
                   const std::function<void(double share)>& progress = {});

}  // namespace stickslip::observer
