// What a person should know of a recording before any model is held against it: is it whole, does
// a channel run into its rails, how finely is it resolved, does the mains sing in it, and is the
// velocity channel late. Nothing here enters the diagnosis; a fault that matters is found by it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "physics/effects/effect.h"
#include "physics/frame.h"
#include "physics/model.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

struct ChannelIntegrity {
  Channel channel = Channel::displacement;
  std::size_t missing = 0;  ///< frames that lack it
  /// Smallest step between two readings where all are multiples of one; 0: finer than can be told.
  double step = 0.0;
  /// Readings that stand still at the lowest and at the highest value for three samples or more.
  std::size_t at_low_rail = 0;
  std::size_t at_high_rail = 0;
  double lowest = 0.0;
  double highest = 0.0;
  std::optional<physics::Line> mains{};  ///< see mains_of
};

struct Integrity {
  std::string source;
  double duration_s = 0.0;
  double rate_hz = 0.0;
  std::size_t frames = 0;
  std::size_t lost = 0;        ///< frames that the time stamps have room for and that are not there
  double longest_gap_s = 0.0;  ///< 0: none
  double jitter = 0.0;         ///< largest departure from a uniform grid, in sampling periods
  std::vector<ChannelIntegrity> channels;
  /// By how much the velocity comes later than the derivative of the displacement, declared filters
  /// taken into account, with its standard error; absent where there is no velocity.
  std::optional<double> velocity_delay_s;
  double velocity_delay_error_s = 0.0;
  /// What of all this a person should look at, in words; empty for a clean recording.
  std::vector<std::string> remarks;
};

/// Looks at a recording of at least 32 frames. `model` gives the sensor chains.
Integrity integrity_of(const protocol::Recording& recording, const physics::Model& model);

}  // namespace stickslip::diagnosis
