// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/candidates.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "physics/catalogue.h"
#include "physics/declared_value.h"

namespace stickslip::diagnosis {

namespace {

bool any_compares(std::span<const Experiment> experiments, Channel channel) {
  return std::any_of(experiments.begin(), experiments.end(),
                     [channel](const Experiment& e) { return e.is_compared(index_of(channel)); });
}

// The recorded channel that drives the rig, which sensor effects can act on too.
std::optional<Channel> driving_channel(const physics::Model& model) {
  switch (model.oscillator.excitation) {
    case physics::Excitation::base:
      return Channel::base_displacement;
    case physics::Excitation::force:
      return Channel::drive_force;
    case physics::Excitation::imposed:
      return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace

std::string CandidateEffect::name() const {
  std::string name(effect->card().id);
  if (is_number()) return name + " of " + parameter;
  if (place.channel) name += " of " + std::string(info(*place.channel).stem);
  if (place.from) name += " from " + std::string(info(*place.from).stem);
  return name;
}

physics::Relation CandidateEffect::relation() const {
  return is_number() ? physics::relation_of(parameter) : effect->card().relation;
}

std::vector<CandidateEffect> candidate_effects(const physics::Model& model,
                                               std::span<const Experiment> experiments) {
  std::vector<CandidateEffect> candidates;
  const auto add = [&](const physics::Effect* effect, const physics::Place& place) {
    if (physics::can_be_missing(*effect, model, place)) candidates.push_back({effect, place});
  };
  for (const physics::Effect* effect : physics::catalogue()) {
    if (effect->card().relation != physics::Relation::sensor) {
      add(effect, {});
      continue;
    }
    for (const Channel channel : all_channels) {
      if (!any_compares(experiments, channel) && channel != driving_channel(model)) continue;
      add(effect, {channel, std::nullopt});
      for (const Channel from : all_channels) {
        if (from != channel && any_compares(experiments, from)) add(effect, {channel, from});
      }
    }
  }
  for (std::string& path : physics::contradictable_numbers(model)) {
    candidates.push_back({&physics::declared_value(), {}, std::move(path)});
  }
  return candidates;
}

namespace {

// True if the effect's one parameter is this quantity of the instrument, and acts on nothing else.
bool sets(const physics::Effect& effect, const physics::InstrumentParameter& instrument) {
  constexpr double some = 1.25e-3;
  physics::ReadingLaws<double> laws;
  effect.set_reading_law(laws, {instrument.channel, std::nullopt}, &some);
  const physics::ReadingLaw<double>& law = laws.of[index_of(instrument.channel)];
  switch (instrument.quantity) {
    case physics::InstrumentQuantity::gain:
      return law.gain == some;
    case physics::InstrumentQuantity::offset:
      return law.offset == some;
    case physics::InstrumentQuantity::delay:
      return law.delay_s == some;
  }
  return false;
}

}  // namespace

bool CandidateEffect::frees(const physics::InstrumentParameter& instrument) const {
  const physics::Card& card = effect->card();
  return card.relation == physics::Relation::sensor && card.parameters.size() == 1 &&
         place.channel == instrument.channel && sets(*effect, instrument);
}

bool CandidateEffect::frees_what_is_declared() const {
  if (is_number()) return true;
  if (!place.channel) return false;
  using enum physics::InstrumentQuantity;
  return frees({*place.channel, gain}) || frees({*place.channel, offset}) ||
         frees({*place.channel, delay});
}

physics::Tier tier_of(const CandidateEffect& candidate) { return candidate.effect->card().tier; }

bool are_rivals(const CandidateEffect& one, const CandidateEffect& other) {
  const auto lists = [](const physics::Card& card, const physics::Card& rival) {
    return std::find(card.rivals.begin(), card.rivals.end(), rival.id) != card.rivals.end();
  };
  const physics::Card& a = one.effect->card();
  const physics::Card& b = other.effect->card();
  return lists(a, b) || lists(b, a);
}

}  // namespace stickslip::diagnosis
