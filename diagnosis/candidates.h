// SPDX-License-Identifier: Apache-2.0
// Effects of the catalogue that a model may lack and that its recordings can show.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/experiment.h"
#include "physics/effect.h"

namespace stickslip::diagnosis {

/// An effect of the catalogue; a sensor effect at one channel. Or a declared number that is wrong.
struct CandidateEffect {
  const physics::Effect* effect = nullptr;
  physics::Place place;
  std::string parameter = {};  ///< path of a number that is freed; empty where a term is added

  /// "stribeck", "gain_error of velocity", "crosstalk of velocity from friction_force", or with the
  /// path of a number after "of"
  std::string name() const;
  /// The relation of the effect, or the one that the number enters.
  physics::Relation relation() const;
  bool is_number() const { return !parameter.empty(); }
  /// True for the effect that frees this gain, offset or delay of an instrument.
  bool frees(const physics::InstrumentParameter& instrument) const;
  /// True for a number, and for an effect that frees the gain, offset or delay of an instrument.
  bool frees_what_is_declared() const;
  friend bool operator==(const CandidateEffect&, const CandidateEffect&) = default;
};

/// Every effect that `model` may lack and that these recordings can show, and every number of it
/// that they may contradict.
std::vector<CandidateEffect> candidate_effects(const physics::Model& model,
                                               std::span<const Experiment> experiments);

physics::Tier tier_of(const CandidateEffect& candidate);

/// True if one of the two lists the other as a rival.
bool are_rivals(const CandidateEffect& one, const CandidateEffect& other);

}  // namespace stickslip::diagnosis
