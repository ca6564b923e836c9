// What a recording could have shown: how large each effect would have to be to be named, and which
// effects it cannot tell apart. Both follow from how an effect moves the readings, less what the
// window states, the calibrated parameters and the base's noise can imitate.
#pragma once

#include <functional>
#include <vector>

#include "diagnosis/shooting.h"
#include "diagnosis/suspects.h"

namespace stickslip::diagnosis {

/// From which size on an effect would have been named.
struct DetectionLimit {
  Suspect suspect;
  double value = 0.0;  ///< of parameter()
  /// By how much a step towards it would lower chi-squared per sample: what of the residuals looks
  /// like this effect.
  double gain = 0.0;

  /// The one that says how much of the effect there is.
  const physics::ParameterCard& parameter() const {
    const physics::Card& card = suspect.effect->card();
    return card.parameters[card.strength.value()];
  }
};

/// Two effects that move the readings alike, as indices into Detection::limits.
struct Lookalikes {
  std::size_t one = 0;
  std::size_t other = 0;
  double cosine = 0.0;  ///< of the angle between what they do, in [0.98, 1]
};

struct Detection {
  std::vector<DetectionLimit> limits;  ///< in the order of the suspects
  std::vector<Lookalikes> lookalikes;  ///< closest first
};

/// `fitted` belongs to `task` and `hypothesis`. An effect counts as named from where it raises
/// chi-squared per sample by `share` on. Effects that replace a law instead of bending it are left
/// out, and so are those whose size no single number tells.
Detection detection_of(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                       const std::vector<Suspect>& suspects,
                       const std::function<physics::Scales(const physics::Place&)>& scales,
                       double share);

}  // namespace stickslip::diagnosis
