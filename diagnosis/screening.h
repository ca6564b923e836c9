// SPDX-License-Identifier: Apache-2.0
// Screening of all candidate effects: a rough fit of each on a subset of windows, refined for the
// best of them.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "diagnosis/fitted_candidate.h"
#include "diagnosis/fitting.h"
#include "diagnosis/residual_features.h"

namespace stickslip::diagnosis {

/// Windows to fit with their states, on the coarse steps and for one thread.
struct WindowSubset {
  Task task;
  std::vector<std::size_t> window;  ///< indices into the windows of SearchData::train
  std::vector<WindowState> state;
};

/// Half of the windows spread over the recording, half where `base` fits worst.
WindowSubset window_subset(const SearchData& data, const FittedCandidate& base);

/// Candidates to try; empty: all.
using CandidateFilter = std::function<bool(const CandidateEffect&)>;

/// Fits on `base` every wanted effect that it may lack, and refines the best; best first, with
/// states for all windows to fit. `progress` is called with the current step and the completed
/// share.
std::vector<FittedCandidate> screen(
    const SearchData& data, const ResidualFeatures& features, const FittedCandidate& base,
    const CandidateFilter& wanted,
    const std::function<void(const std::string& step, double done)>& progress);

}  // namespace stickslip::diagnosis
