// What a model's [[physics]] terms say is wrong with readings, taken back from them before the
// filter sees them: limit, curvature, gain, and what leaks in from other channels. Delays, hum and
// drift cannot be: the filter has states for them (reading_states.h).
#pragma once

#include <Eigen/Core>
#include <array>

#include "physics/effects/effect.h"
#include "physics/frame.h"
#include "physics/model.h"

namespace stickslip::observer {

/// A model without the terms that only say how channels are read, and what those say.
struct Followed {
  physics::Model model;
  physics::ReadingLaws<double> laws;
};

/// A differentiator that rolls off elsewhere is in the model's own chain afterwards. Throws
/// std::invalid_argument where inconsistencies_of(declared) is not empty.
Followed followed(const physics::Model& declared);

class Misreadings {
 public:
  explicit Misreadings(const physics::ReadingLaws<double>& laws);

  bool any() const { return any_; }

  using PerChannel = std::array<double, channel_count>;

  /// Puts the readings of a frame right; those that cannot be are no longer valid. `variance` is of
  /// the readings, and becomes that of what is left.
  void take_back(Frame& frame, PerChannel& variance);

  /// How much more a righted reading changes than what was read, in the last frame.
  double stretch(Channel channel) const { return stretch_[index_of(channel)]; }

 private:
  physics::ReadingLaws<double> laws_;
  bool any_;
  /// What the channels were before others leaked into them.
  Eigen::Matrix<double, channel_count, channel_count> apart_;
  PerChannel stretch_;
};

}  // namespace stickslip::observer
