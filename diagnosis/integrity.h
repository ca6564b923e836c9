// SPDX-License-Identifier: Apache-2.0
// Integrity of a recording before any model is compared with it: missing samples, clipping,
// resolution, mains lines, and the delay of the velocity channel. For the reader only; the
// diagnosis finds the faults that matter by itself.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/criteria.h"
#include "diagnosis/outliers.h"
#include "physics/effect.h"
#include "physics/frame.h"
#include "physics/model.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

struct ChannelIntegrity {
  Channel channel = Channel::displacement;
  std::size_t missing = 0;  ///< frames without this channel
  /// Quantisation step, where all readings are multiples of one; 0: too fine to be detected.
  double step = 0.0;
  /// Readings in runs of three or more at the lowest and at the highest value.
  std::size_t at_low_rail = 0;
  std::size_t at_high_rail = 0;
  double lowest = 0.0;
  double highest = 0.0;
  /// Mains line, or what is seen of it, that matters beside the noise and is none of the drive.
  std::optional<physics::Line> mains{};
  double mains_hz = 0.0;            ///< its frequency before sampling
  std::vector<Outlier> outliers{};  ///< not used, and not counted elsewhere
};

struct Integrity {
  std::string source;
  double duration_s = 0.0;
  double rate_hz = 0.0;
  std::size_t frames = 0;
  std::size_t lost = 0;        ///< frames missing from the time grid
  double longest_gap_s = 0.0;  ///< 0: no gap
  double jitter = 0.0;         ///< largest departure from a uniform grid, in sampling periods
  std::vector<ChannelIntegrity> channels;
  /// Delay of the velocity behind the derivative of the displacement, declared filters taken into
  /// account, with its standard error; absent without a velocity channel.
  std::optional<double> velocity_delay_s;
  double velocity_delay_error_s = 0.0;
  /// Conspicuous properties, in words; empty for a clean recording.
  std::vector<std::string> remarks;
};

/// Of a recording of at least 32 frames. `model` gives the sensor chains.
Integrity integrity_of(const protocol::Recording& recording, const physics::Model& model,
                       const Criteria& criteria = {});

}  // namespace stickslip::diagnosis
