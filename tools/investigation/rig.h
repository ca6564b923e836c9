// SPDX-License-Identifier: Apache-2.0
// The rig of an investigation: what it can do, and how one run is made on it.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <stop_token>
#include <string>

#include "diagnosis/design/drive.h"
#include "diagnosis/design/expected_motion.h"
#include "protocol/recording.h"

namespace stickslip::investigation {

struct RigFacts {
  std::string name;
  bool force = false;  ///< driven by a force, otherwise by its base
  double rate_hz = 1000.0;
  design::DriveLimits limits;
  design::MotionRanges ranges;
  bool displacement_range_assumed = false;  ///< none is configured
};

class Rig {
 public:
  Rig() = default;
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;
  virtual ~Rig() = default;

  virtual const RigFacts& facts() const = 0;

  /// Plays the drive once and records it; the amplifier is off afterwards, whatever happens. Throws
  /// InputError where the rig refuses or faults, diagnosis::Interrupted once `stop` is requested.
  /// `waiting`: called once, with what a person has to do before the rig may move.
  virtual protocol::Recording run(const design::Drive& drive, std::stop_token stop,
                                  const std::function<void(const std::string&)>& waiting) = 0;
};

/// Range of the displacement where none is configured, over the limit of the base's displacement.
inline constexpr double assumed_displacement = 4.0;
/// The same of a force-excited rig [m].
inline constexpr double assumed_displacement_m = 0.06;

/// Completes the facts by the range that is assumed.
inline RigFacts with_displacement_range(RigFacts facts) {
  const std::size_t x = index_of(Channel::displacement);
  if (std::isfinite(facts.ranges.high[x]) && std::isfinite(facts.ranges.low[x])) return facts;
  const double most =
      facts.force ? assumed_displacement_m : assumed_displacement * facts.limits.value;
  facts.ranges.high[x] = std::min(facts.ranges.high[x], most);
  facts.ranges.low[x] = std::max(facts.ranges.low[x], -most);
  facts.displacement_range_assumed = true;
  return facts;
}

}  // namespace stickslip::investigation
