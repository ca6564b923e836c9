// SPDX-License-Identifier: Apache-2.0
// The candidates for one more effect: screened, the best of them fitted on all windows, ranked.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "diagnosis/fitted_candidate.h"
#include "diagnosis/fitting.h"
#include "diagnosis/residual_features.h"
#include "diagnosis/screening.h"

namespace stickslip::diagnosis {

/// The candidates of a screening on `base` that are worth a fit on all windows. `progress` and
/// `wanted` as in screen().
std::vector<FittedCandidate> finalists(
    const SearchData& data, const ResidualFeatures& features, const FittedCandidate& base,
    const std::function<void(const std::string& step, double done)>& progress,
    const CandidateFilter& wanted = {});

/// Ranks fitted finalists for an addition to `current`. Those that the recording does not determine
/// are dropped, unless it determines none.
void rank_determined(std::vector<FittedCandidate>& candidates, const SearchData& data,
                     const HeldOut& current, std::uint64_t seed);

}  // namespace stickslip::diagnosis
