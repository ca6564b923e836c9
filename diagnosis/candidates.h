// Effects of the catalogue that a model may lack and that its recordings can show.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "diagnosis/experiment.h"
#include "physics/effect.h"

namespace stickslip::diagnosis {

/// An effect of the catalogue; a sensor effect at one channel.
struct CandidateEffect {
  const physics::Effect* effect = nullptr;
  physics::Place place;

  /// "stribeck", "gain_error of velocity", "crosstalk of velocity from friction_force"
  std::string name() const;
  friend bool operator==(const CandidateEffect&, const CandidateEffect&) = default;
};

/// Every effect that `model` may lack and that these recordings can show.
std::vector<CandidateEffect> candidate_effects(const physics::Model& model,
                                               std::span<const Experiment> experiments);

physics::Tier tier_of(const CandidateEffect& candidate);

/// True if one of the two lists the other as a rival.
bool are_rivals(const CandidateEffect& one, const CandidateEffect& other);

}  // namespace stickslip::diagnosis
