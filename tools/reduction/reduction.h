// SPDX-License-Identifier: Apache-2.0
// Reduction of a recording to a coefficient of friction, by the method of section 3.4 of the paper
// and by deconvolution. Gains, offsets and delays that the model declares are removed from the
// readings first.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "physics/model.h"
#include "protocol/recording.h"

namespace stickslip::reduction {

enum class Method : std::uint8_t {
  /// The paper's: 800 samples as they were read, drift removed from friction force and input, Eq.
  /// (1) with the drive's frequency, division by the normal load as it was read.
  paper,
  /// Any length; the filters of all channels inverted, the load cell's equation instead of Eq. (1).
  /// The first and the last tenth of a second are used but not returned: the state of the filters
  /// is unknown there.
  deconvolved,
};

struct Options {
  Method method = Method::deconvolved;
  std::optional<std::size_t> samples;  ///< absent: 800 (paper), else all
  /// First sample of the recording to use; absent: the first of the longest stretch without a gap
  /// in time or in a channel.
  std::optional<std::size_t> first;
  std::optional<double> drive_hz;  ///< of Eq. (1); absent: the strongest tone of the base
  std::size_t bins = 24;           ///< of the surface, along each axis
  /// Steady sliding: abs(v) above this share of its largest value.
  double sliding_share = 0.5;
};

/// One sample with its coefficient of friction.
struct Sample {
  double time_s = 0.0;
  double displacement_m = 0.0;
  double velocity_m_s = 0.0;
  double base_displacement_m = 0.0;
  double friction_force_n = 0.0;  ///< on the mass
  double normal_load_n = 0.0;
  double mu = 0.0;  ///< not finite where the load is below a twentieth of its mean
};

/// One cell of the surface mu(x, v). Consecutive samples share their state, so each visit to the
/// cell counts once: the standard error is that of the mean over visits.
struct Cell {
  double displacement_m = 0.0;  ///< centre
  double velocity_m_s = 0.0;
  std::size_t samples = 0;
  std::size_t visits = 0;
  double mu = 0.0;              ///< mean over visits
  double scatter = 0.0;         ///< standard deviation over samples
  double standard_error = 0.0;  ///< of the mean; the scatter itself after a single visit
};

struct Range {
  double low = 0.0;
  double high = 0.0;
};

struct Reduction {
  std::vector<Sample> samples;
  std::size_t first = 0;      ///< of the recording's samples
  double period_s = 0.0;      ///< between samples
  std::vector<Cell> surface;  ///< cells with samples, by displacement, then velocity
  double drive_hz = 0.0;
  double inertia_share =
      0.0;  ///< largest m_l b'' over the largest friction force: the size of Eq. (1)'s correction
  Range normal_load_n;
  Range sliding_mu;  ///< 10 % to 90 % quantiles of mu sign(v) in steady sliding
  /// Straight line N = load_n (1 + slope_per_m x) through the samples, and its share of the
  /// variance of N.
  double load_n = 0.0;
  double slope_per_m = 0.0;
  double linear_share = 0.0;
  /// Share of the samples at mu and v of opposite sign; below 2 % of the largest abs(v), where
  /// noise has the sign, none is counted.
  double negative_friction = 0.0;
};

/// Reduces consecutive samples. Throws InputError where the recording lacks
/// displacement_m, velocity_m_s, friction_force_n, normal_load_n or base_displacement_m, or has
/// fewer consecutive samples than requested, and where the model has no load cell or is not driven
/// by its base.
Reduction reduce(const protocol::Recording& recording, const physics::Model& model,
                 const Options& options = {});

}  // namespace stickslip::reduction
