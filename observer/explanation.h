// What has changed in a rig that no longer follows its model: the frames since then, gone through
// again by a filter for each suspect, and how well each explains them. Slow, with memory of its
// own: not for the loop.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "observer/model_check.h"
#include "physics/effects/effect.h"
#include "physics/frame.h"
#include "physics/model.h"

namespace stickslip::observer {

/// One suspect at the size that explains the frames best.
struct Explanation {
  physics::Relation relation = physics::Relation::friction_law;
  Channel channel = Channel::displacement;  ///< Relation::sensor only
  std::string words;                        ///< "the load cell's natural frequency is 14.1 Hz ..."
  double size = 0.0;            ///< of the suspect, in its own unit; what `words` speaks of
  double log_likelihood = 0.0;  ///< of the readings, above that of the model as it was
  double probability = 0.0;     ///< of this suspect against all others, 0 to 1
};

/// Until when frames help to explain an alarm: what comes later is another time.
std::int64_t explained_until_ns(const ModelVerdict& verdict);

/// The least number of seconds of frames after a break that can be gone through.
inline constexpr double least_explained_s = 1.5;

/// Suspects, most probable first; empty where fewer than least_explained_s of frames follow the
/// break, or the observer does not follow the model. `period_s`: of the frames, > 0. Frames before
/// the break are left out.
std::vector<Explanation> explanations_of(const physics::Model& believed, double period_s,
                                         std::span<const Frame> frames,
                                         const ModelVerdict& verdict);

}  // namespace stickslip::observer
