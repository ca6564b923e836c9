// SPDX-License-Identifier: Apache-2.0
// The hypotheses that the recordings of a diagnosis do not exclude, each as models that can be
// simulated. The design of the next run rests on them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "physics/model.h"

namespace stickslip::diagnosis {

class Search;

/// One hypothesis about what the declared model lacks.
struct OpenHypothesis {
  std::string id;    ///< of the effect in the catalogue, or of the number; "nothing" for none
  std::string name;  ///< "gain_error of velocity", or "nothing is missing"
  std::string statement;
  double probability = 0.0;  ///< relative to the others
  /// The fitted model, then models that are one standard deviation off along the principal axes of
  /// the posterior of its parameters, the widest first.
  std::vector<physics::Model> models;
};

/// Of the claim that is the least certain, or, where nothing was claimed, of the calibrated
/// declared model and the candidates that came nearest; most probable first, probabilities sum
/// to 1. Improbable ones are left out. Deterministic for a seed.
std::vector<OpenHypothesis> open_hypotheses_of(const Search& search, std::size_t axes,
                                               std::uint64_t seed);

}  // namespace stickslip::diagnosis
