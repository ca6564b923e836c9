// SPDX-License-Identifier: Apache-2.0
// Whether a model leaves noise: chi-squared against its own uncertainty.
#pragma once

#include <span>
#include <vector>

#include "diagnosis/criteria.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

struct NoiseLevel {
  Channel channel = Channel::displacement;
  double level = 1.0;    ///< noise found over noise expected, as standard deviations
  bool differs = false;  ///< from 1, beyond its uncertainty
};

/// The residuals of a calibrated model in windows that nothing was fitted to.
struct NoiseCheck {
  /// True if chi-squared per sample is 1 within its uncertainty, or if what is left is noise of
  /// another level: alike in all windows, no sample follows its predecessor, and no channel
  /// another.
  bool is_noise = false;
  /// True if, besides, the level is the expected one, alike in all windows up to the scatter of
  /// noise, no sample follows its predecessor, and no channel another.
  bool is_expected_noise = false;
  /// Of every compared channel, if it is noise.
  std::vector<NoiseLevel> level;
};

/// `task.sigma` is the expected noise, `estimated` if a recording gave it and no model did. The
/// uncertainty of chi-squared follows from its scatter over windows, and from
/// Criteria::confirmed_noise_log where the noise is an estimate.
NoiseCheck noise_check(const Task& task, const Hypothesis& hypothesis, std::span<const double> z,
                       bool estimated, const Criteria& criteria);

}  // namespace stickslip::diagnosis
