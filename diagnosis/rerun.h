// A recording made again by a model: under the drive of the one that it was made with, or under
// another that a bench can make of it.
#pragma once

#include <cstdint>

#include "diagnosis/experiment.h"
#include "physics/model.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

/// How a run differs from the one that was recorded.
struct Rerun {
  double amplitude = 1.0;  ///< of the drive, over that of the recording
  double pace = 1.0;       ///< the same accelerations, so many times as fast
  double burst_s = 0.0;    ///< drive for so long, then rest for as long; 0: no rests
  double release = 0.0;    ///< starts at rest at that share of the largest deflection
  double longest_s = 0.0;  ///< ends after so long; 0: as long as the recording
};

/// The model with the noise of every channel as it is in the recording, declared or estimated.
physics::Model with_noise_of(physics::Model model, const Experiment& recorded);

/// What `model` would have recorded, in the channels and at the times of `recorded`.
protocol::Recording rerun(const Experiment& recorded, const physics::Model& model, const Rerun& run,
                          std::uint64_t seed);

}  // namespace stickslip::diagnosis
