// SPDX-License-Identifier: Apache-2.0
// Simulation of a recording by a model, under the recorded drive or under a variation of it that a
// bench can produce.
#pragma once

#include <cstdint>

#include "diagnosis/experiment.h"
#include "physics/model.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

/// Variation of the recorded run.
struct Rerun {
  double amplitude = 1.0;  ///< of the drive, over that of the recording
  double pace = 1.0;       ///< speed factor, at the same accelerations
  double burst_s = 0.0;    ///< length of alternating drive and rest; 0: no rests
  double release = 0.0;    ///< initial deflection over the largest one, released from rest
  double longest_s = 0.0;  ///< longest duration; 0: that of the recording
  bool from_recorded_state = false;  ///< begins with the guess of the recorded motion
};

/// The model with the declared or estimated noise of every recorded channel.
physics::Model with_noise_of(physics::Model model, const Experiment& recorded);

/// Simulated recording of `model`, in the channels and at the times of `recorded`.
protocol::Recording rerun(const Experiment& recorded, const physics::Model& model, const Rerun& run,
                          std::uint64_t seed);

}  // namespace stickslip::diagnosis
