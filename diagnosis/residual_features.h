// SPDX-License-Identifier: Apache-2.0
// Features of the residuals (spectral lines, episodes) and sizes of the recorded quantities, from
// which effects choose their starting values.
#pragma once

#include <array>
#include <span>
#include <utility>
#include <vector>

#include "diagnosis/experiment.h"
#include "diagnosis/hypothesis.h"
#include "diagnosis/shooting.h"
#include "physics/effect.h"

namespace stickslip::diagnosis {

/// Of the residuals over the whole first experiment; in a campaign, over all of them.
struct ResidualFeatures {
  std::array<physics::Line, predicted_channels> line;  ///< by channel; amplitude 0: none
  std::vector<double> frequencies_hz;                 ///< of all channels together, strongest first
  std::vector<std::pair<double, double>> episodes_s;  ///< begin and end, from the first sample
};

/// `fitted` belongs to `task`, whose windows cover the recordings.
ResidualFeatures residual_features(const Task& task, const Hypothesis& hypothesis,
                                   const Fit& fitted);

/// Scales for the starting values of an effect at `place`.
physics::Scales scales_of(std::span<const Experiment> experiments, const Hypothesis& hypothesis,
                          std::span<const double> z, const ResidualFeatures& features,
                          const physics::Place& place);

}  // namespace stickslip::diagnosis
