// SPDX-License-Identifier: Apache-2.0
// Detection limits of a recording: the size from which each effect would be claimed, and the
// effects that the recording cannot separate. Both follow from the change of the readings that an
// effect causes, less the part that window states, calibrated parameters and the drive's noise
// absorb.
#pragma once

#include <functional>
#include <vector>

#include "diagnosis/candidates.h"
#include "diagnosis/criteria.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// Size of an effect from which it would be claimed.
struct DetectionLimit {
  CandidateEffect candidate;
  double value = 0.0;  ///< of parameter()
  /// Decrease of chi-squared per sample by a step towards the effect: the part of the residuals
  /// that it explains to first order.
  double gain = 0.0;

  /// The parameter that measures the strength of the effect.
  const physics::ParameterCard& parameter() const {
    const physics::Card& card = candidate.effect->card();
    return card.parameters[card.strength.value()];
  }
};

/// Two effects with nearly the same influence on the readings, as indices into Detection::limits.
struct InseparablePair {
  std::size_t one = 0;
  std::size_t other = 0;
  double cosine =
      0.0;  ///< of the angle between their influences, Criteria::inseparable_cosine to 1
};

struct Detection {
  std::vector<DetectionLimit> limits;        ///< in the order of the candidates
  std::vector<InseparablePair> inseparable;  ///< closest first
  double samples = 0.0;                      ///< that the gains are per sample of
};

/// `fitted` belongs to `task` and `hypothesis`. At its limit an effect raises chi-squared per
/// sample by Criteria::detection_chi2. Effects that replace a law instead of modifying it
/// are left out, and so are those without a strength parameter.
Detection detection_limits(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                           const std::vector<CandidateEffect>& candidates,
                           const std::function<physics::Scales(const physics::Place&)>& scales,
                           const Criteria& criteria);

}  // namespace stickslip::diagnosis
