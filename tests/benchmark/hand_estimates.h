// SPDX-License-Identifier: Apache-2.0
// Friction, theta and slip as a laboratory computes them from a recording without an observer. The
// comparison is generous to it: of several formulas, cutoffs and loads the one with the smallest
// error is taken, by recording and quantity, as if the truth had been known.
#pragma once

#include <optional>
#include <span>

#include "physics/model.h"
#include "physics/simulator.h"
#include "protocol/recording.h"

namespace stickslip::quality {

/// RMS errors relative to the RMS of the truth; absent where the truth is 0 throughout. The first
/// and the last quarter of a second do not count: the state of the filters is unknown there.
struct HandErrors {
  std::optional<double> force;
  /// f / (mu N), limited to -1 to 1; the sign of the velocity where N is below a twentieth of its
  /// mean.
  std::optional<double> theta;
  std::optional<double> slip;
  std::optional<double> auc;  ///< of stick against slip, classified by the slip speed
};

struct HandEstimates {
  /// From the readings up to each frame: Eq. (1) on the readings as they are, or the force balance
  /// where the friction force is not recorded. Channels that are differentiated are smoothed by a
  /// causal low-pass.
  HandErrors causal;
  /// Of these and estimates from the whole recording: filters of all channels inverted, Eq. (1) or
  /// the load cell's whole equation, or the force balance; low-pass without phase.
  HandErrors best;
};

/// `truth`: at the frames of the recording. `sticking_below_m_s`: true slip speed of a sticking
/// contact. Every channel that the first frame has must be in all frames.
HandEstimates estimates_by_hand(const protocol::Recording& recording, const physics::Model& model,
                                std::span<const physics::RigTruth> truth,
                                double sticking_below_m_s);

}  // namespace stickslip::quality
