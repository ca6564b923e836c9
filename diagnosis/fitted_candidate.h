// SPDX-License-Identifier: Apache-2.0
// A candidate effect added to a model, with its fit and its score.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/candidates.h"
#include "diagnosis/criteria.h"
#include "diagnosis/held_out.h"
#include "diagnosis/hypothesis.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

struct FittedCandidate {
  CandidateEffect candidate;  ///< the effect added last; none in the declared model
  std::optional<Hypothesis> hypothesis;
  Fit fitted;
  HeldOut held_out;
  double gain_z = 0.0;  ///< over the model that it was added to

  double total_loss() const { return held_out.total_loss(); }
};

/// Complexity [nat]: one for every parameter that the effects need, every channel that they take
/// from and every hidden state, Criteria::unlisted_complexity for unlisted physics, and
/// Criteria::contradiction_complexity for an effect that frees what is declared.
double complexity_of(const FittedCandidate& each, const Criteria& criteria);

/// `base` with the candidate: an effect with parameters that start at `start` (see
/// Hypothesis::with), or a number freed.
Hypothesis extended(const Hypothesis& base, const CandidateEffect& candidate,
                    std::span<const double> start, std::span<const double> fixed, Detail detail);

/// A candidate's parameter: its position on the card, its index among the numbers of the rig (-1
/// where the model leaves it at its default).
struct OwnParameter {
  std::size_t position = 0;
  int index = -1;
};

/// Those of the candidate effect, in the order of its card.
std::vector<OwnParameter> own_indices(const FittedCandidate& each);

/// Fitted parameters of the candidate effect, in the order of its card.
std::vector<double> own_parameters(const FittedCandidate& each);

/// The candidate in words, with its fitted numbers.
std::string statement_of(const FittedCandidate& each);

/// True if the recording determines every positive parameter that the effect needs, and one of
/// those of either sign to better than its plausible range. A hysteresis with any slip force has
/// not been observed to slip: it imitates a spring.
bool is_determined(const FittedCandidate& each, const Criteria& criteria);

/// Unknowns that are calibrated numbers of the rig, not of its instruments, and that the fit puts
/// beyond what the model allows for.
std::vector<std::size_t> contradicted_rig_unknowns(const FittedCandidate& each,
                                                   const Criteria& criteria);

/// True for an effect with sizes of either sign that are all none within their uncertainty: it
/// gains by the states that it adds, which are free in every window. A mode that nothing excites
/// follows any hum.
bool acts_by_its_states_alone(const FittedCandidate& each, const Criteria& criteria);

/// True if the effect replaces a law of `base` instead of modifying it: the gain of one step from
/// the law without it is not informative.
bool replaces_law(const Hypothesis& base, const Hypothesis& with);

}  // namespace stickslip::diagnosis
