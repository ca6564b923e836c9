// SPDX-License-Identifier: Apache-2.0
// The noise that the residuals of a fit show: its level and its colour.
#pragma once

#include <array>

#include "diagnosis/criteria.h"
#include "diagnosis/noise_colour.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

struct NoiseEstimate {
  NoiseColours colour;
  std::array<double, predicted_channels> sigma{};  ///< as Task::sigma
  bool contradicts_declaration = false;            ///< of the level of any channel
};

/// The most probable noise of residuals in the windows of `task`: its own in channels in which no
/// other gains more than Criteria::claim_nats, and coloured where that gains as much over white.
/// The level is estimated, too, in channels without declared noise, and, unless `keeps_declared`,
/// where the residuals contradict the declared one by as much and beyond
/// Criteria::confirmed_noise_log.
NoiseEstimate noise_in_residuals(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                                 bool keeps_declared, const Criteria& criteria);

}  // namespace stickslip::diagnosis
