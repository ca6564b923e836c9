// SPDX-License-Identifier: Apache-2.0
// Choice among fitted candidates: probabilities, and preference of simple and listed physics.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "diagnosis/fitted_candidate.h"
#include "diagnosis/fitting.h"

namespace stickslip::diagnosis {

/// Probability of each candidate relative to the others, by the Bayesian bootstrap over held-out
/// windows and a prior that falls with complexity. Deterministic for a seed.
std::vector<double> probabilities(const std::vector<FittedCandidate>& candidates,
                                  const Criteria& criteria, std::uint64_t seed);

/// True if the simpler effect is preferred to `best`, which scores better but not clearly: a law
/// with one more parameter or hidden state always imitates the law without it. `gain` is that of
/// `best`.
bool is_preferred(const FittedCandidate& simple, const FittedCandidate& best, double gain,
                  const Criteria& criteria);

/// Sorts candidates for an addition to `current`, most probable first except for the preferences of
/// `criteria`: simpler effects, and lower tiers.
void rank(std::vector<FittedCandidate>& candidates, const SearchData& data, const HeldOut& current,
          std::uint64_t seed);

/// Moves the element at `index` to the front; the others keep their order.
template <class T>
void move_to_front(std::vector<T>& values, std::size_t index) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(index);
  std::rotate(values.begin(), at, at + 1);
}

}  // namespace stickslip::diagnosis
