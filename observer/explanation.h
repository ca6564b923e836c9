// Explanation of a rig that no longer follows its model: the frames since the break are filtered
// again for each candidate change and compared by likelihood. Candidates are declared parameters
// and the effects of the catalogue that can set in (physics::Onset). Allocates, and takes about a
// second: not for the real-time loop.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "observer/model_check.h"
#include "physics/effect.h"
#include "physics/frame.h"
#include "physics/model.h"

namespace stickslip::observer {

/// One candidate change at the size that explains the frames best.
struct Explanation {
  physics::Relation relation = physics::Relation::friction_law;
  Channel channel = Channel::displacement;  ///< Relation::sensor only
  std::string words;                        ///< "the load cell's natural frequency is 14.1 Hz ..."
  double size = 0.0;            ///< of the change, in its own unit; as stated in `words`
  double log_likelihood = 0.0;  ///< of the readings, relative to the unchanged model
  double probability = 0.0;     ///< relative to all candidates, 0 to 1
};

/// End of the frames that are used to explain an alarm.
std::int64_t explained_until_ns(const ModelVerdict& verdict);

/// Minimum duration of frames after a break that can be evaluated.
inline constexpr double min_explained_s = 1.5;

/// Candidates, most probable first; empty where fewer than min_explained_s of frames follow the
/// break, or the observer does not support the model. `period_s`: of the frames, > 0. Frames before
/// the break are ignored.
std::vector<Explanation> explanations_of(const physics::Model& believed, double period_s,
                                         std::span<const Frame> frames,
                                         const ModelVerdict& verdict);

}  // namespace stickslip::observer
