// SPDX-License-Identifier: Apache-2.0
// The expected difference of the log predictive densities of two hypotheses
// where one of them is true.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "diagnosis/design/drive.h"
#include "diagnosis/open_hypotheses.h"
#include "physics/frame.h"

namespace stickslip::design {

/// Of one hypothesis that is true against one that is not.
struct PairSeparation {
  std::size_t truth = 0;
  std::size_t other = 0;
  /// Difference of the expected log predictive densities on the windows that a diagnosis compares
  /// hypotheses on [nat].
  double expected = 0.0;
  double error = 0.0;  ///< its standard error over the windows of the run [nat]

  /// Less one standard error, not below 0.
  double safe() const { return expected > error ? expected - error : 0.0; }
};

struct SeparationSettings {
  double horizon_s = 0.5;   ///< of a prediction
  double rate_hz = 1000.0;  ///< at which the rig is recorded
  /// Standard deviation of every reading: what a comparison of predictions rests on.
  std::array<double, channel_count> noise_std{};
  std::size_t most_windows = 12;  ///< predicted in each run, evenly spread
  int threads = 1;
};

/// Of every ordered pair of hypotheses of which the first is the fitted model of one of them. In
/// each window the wrong hypothesis starts from the state that it reads there, which is then
/// fitted; its parameters move along the axes of their posterior, in all windows alike, to where
/// they predict the run best.
std::vector<PairSeparation> separations(const std::vector<diagnosis::OpenHypothesis>& hypotheses,
                                        const Drive& drive, const SeparationSettings& settings);

/// Share of the open probability that the run is expected to close, 0 to 1: the mean over truths
/// of what the others hold, each times s / (s + enough_nats) of its separation s.
double expected_gain(const std::vector<diagnosis::OpenHypothesis>& hypotheses,
                     const std::vector<PairSeparation>& separations);

/// Separation of which the half of a hypothesis counts as excluded [nat]. A little above the 4.6
/// nat that stand for 99 %: a fit to all windows follows more than these do one by one.
inline constexpr double enough_nats = 5.0;

}  // namespace stickslip::design
