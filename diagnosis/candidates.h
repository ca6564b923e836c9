// SPDX-License-Identifier: Apache-2.0
// Effects of the catalogue, and formulas of the model file, that a model may lack and that its
// recordings can show.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/experiment.h"
#include "physics/campaign.h"
#include "physics/effect.h"

namespace stickslip::diagnosis {

/// An effect of the catalogue or a formula; a sensor effect at one channel. Or a declared number
/// that is wrong.
struct CandidateEffect {
  const physics::Effect* effect = nullptr;
  physics::Place place;
  std::string parameter = {};  ///< path of a number that is freed; empty where a term is added
  /// The relation that this number enters.
  physics::Relation number_enters = physics::Relation::force_balance;

  /// How its number differs between the recordings of a campaign; without a path: not at all.
  physics::SharedNumber shared = {};

  /// "stribeck", "gain_error of velocity", "crosstalk of velocity from friction_force", or with the
  /// path of a number after "of"; in a campaign with "in each recording" or "with load_n" after it
  std::string name() const;
  /// The relation of the effect, or the one that the number enters.
  physics::Relation relation() const;
  bool is_number() const { return !parameter.empty(); }
  /// True for one that shows only in the comparison of recordings.
  bool is_comparison() const { return !shared.path.empty(); }
  /// True for the effect that frees this gain, offset or delay of an instrument.
  bool frees(const physics::InstrumentParameter& instrument) const;
  /// True for a number, and for an effect that frees the gain, offset or delay of an instrument.
  bool frees_what_is_declared() const;
  friend bool operator==(const CandidateEffect&, const CandidateEffect&) = default;
};

/// Every effect that `model` may lack and that these recordings can show, and every number of it
/// that they may contradict.
std::vector<CandidateEffect> candidate_effects(const physics::Model& model,
                                               std::span<const Experiment> experiments,
                                               const physics::Campaign* campaign = nullptr);

/// Numbers, and instruments, that may differ between the recordings of a campaign where `model` has
/// them in common: in each recording, or with one of the conditions.
std::vector<CandidateEffect> comparison_candidates(const physics::Model& model,
                                                   std::span<const Experiment> experiments,
                                                   const physics::Campaign& campaign);

/// How a number that is common may differ between the recordings: by itself in each, or with a
/// condition; of two recordings, which a condition distinguishes, only the latter.
std::vector<physics::SharedNumber> differences_of(const std::string& path,
                                                  const physics::Campaign& campaign);

physics::Tier tier_of(const CandidateEffect& candidate);

/// Share of what the candidate explains that its formula may leave (physics::Card).
double formula_residual(const CandidateEffect& candidate);

/// Position of the strength of an effect that has one, in a start of `size` numbers: some leave out
/// the parameters with a default.
std::size_t strength_in(const physics::Card& card, std::size_t size);

/// True if one of the two lists the other as a rival.
bool are_rivals(const CandidateEffect& one, const CandidateEffect& other);

}  // namespace stickslip::diagnosis
