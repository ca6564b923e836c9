// What a model's [[physics]] terms say is wrong with readings. Taken back from each reading before
// the filter sees it: gain and curvature; a reading at its limit is left out. The rest cannot be:
// the filter has states for delays, hum and drift (reading_states.h), and sees a leak in the
// channel that it leaks into (sight_of).
#pragma once

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

  bool any() const { return laws_.wrong; }

  using PerChannel = std::array<double, channel_count>;

  /// Makes readings invalid that only say that the truth is beyond a limit. `variance`: of
  /// readings.
  void leave_out_limited(Frame& frame, const PerChannel& variance) const;

  /// Puts the other readings of a frame right; those that cannot be are no longer valid. `variance`
  /// becomes that of what is left.
  void take_back(Frame& frame, PerChannel& variance);

  /// d righted / d read of a channel in the last frame that had it.
  double stretch(Channel channel) const { return stretch_[index_of(channel)]; }

 private:
  physics::ReadingLaws<double> laws_;
  PerChannel stretch_;
};

}  // namespace stickslip::observer
