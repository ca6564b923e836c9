// SPDX-License-Identifier: Apache-2.0
// Design of the experiment that separates two hypotheses: runs that a bench can make are simulated
// by one hypothesis and fitted by the other.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "diagnosis/criteria.h"
#include "diagnosis/experiment.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

struct Separation {
  std::string run;           ///< "the same drive, twice as large"
  double chi2_excess = 0.0;  ///< excess chi-squared per sample of the wrong hypothesis in that run
  double chi2_repeated = 0.0;  ///< the same in a repetition of the recorded run
};

/// The run that separates the two best, among variations of the drive, its pace and the load of
/// `recorded`; none where no run separates them much better than the recorded one. Deterministic
/// for a seed.
std::optional<Separation> separation_of(const Experiment& recorded, const FittedHypothesis& one,
                                        const FittedHypothesis& other, double horizon_s,
                                        std::uint64_t seed, int threads,
                                        const Criteria& criteria = {});

/// A sentence for a report.
std::string sentence_of(const Separation& separation);

}  // namespace stickslip::diagnosis
