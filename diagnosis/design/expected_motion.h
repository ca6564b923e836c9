// SPDX-License-Identifier: Apache-2.0
// The motion of a rig under a drive as a model has it, and what of the drive stays within the
// ranges of the channels for every model that is possible.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "diagnosis/design/drive.h"
#include "physics/frame.h"
#include "physics/model.h"
#include "physics/simulator.h"

namespace stickslip::design {

/// Permitted ranges of the channels, SI.
struct MotionRanges {
  std::array<double, channel_count> low{};
  std::array<double, channel_count> high{};

  MotionRanges() {
    low.fill(-std::numeric_limits<double>::infinity());
    high.fill(std::numeric_limits<double>::infinity());
  }
};

/// A simulated run without noise.
struct Motion {
  double period_s = 0.0;          ///< of the readings
  std::size_t samples_apart = 1;  ///< of the drive, from reading to reading
  std::vector<Frame> readings;
  std::vector<physics::RigTruth> state;  ///< at the readings
  std::array<double, channel_count> lowest{};
  std::array<double, channel_count> highest{};
  bool finite = true;
};

/// Of the whole drive from rest; `samples_apart` samples of the drive to each reading.
Motion motion_of(const physics::Model& model, const Drive& drive, std::size_t samples_apart);

/// Readings of a stretch of the drive, from a state at its sample `begin`.
std::vector<Frame> readings_from(const physics::Model& model, const Drive& drive,
                                 const physics::RigTruth& start, std::size_t begin,
                                 std::size_t count, std::size_t samples_apart);

/// The model with its spring, or its wells, `factor` times as stiff.
physics::Model with_stiffness(physics::Model model, double factor);

/// Factors on the stiffness with which a run has to stay within its limits: models may be wrong.
inline constexpr std::array stiffness_factors = {1.0, 0.7, 1.3, 0.8, 1.2, 0.9, 1.1};

/// The largest values of the channels over models, each with several stiffnesses.
struct Extent {
  std::array<double, channel_count> lowest{};
  std::array<double, channel_count> highest{};
};

struct Bounded {
  Drive drive;
  double factor = 1.0;  ///< on the given drive
  Extent extent;
};

/// The drive, made smaller until every model with every one of `factors` on its stiffness stays
/// within `share` of the ranges; nothing where no drive does. Zero has to be within the ranges.
std::optional<Bounded> within_ranges(std::span<const physics::Model> models,
                                     std::span<const double> factors, const Drive& drive,
                                     const MotionRanges& ranges, double share, int threads);

}  // namespace stickslip::design
