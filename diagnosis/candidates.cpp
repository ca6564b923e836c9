#include "diagnosis/candidates.h"

#include <algorithm>
#include <optional>

#include "physics/catalogue.h"

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
  if (place.channel) name += " of " + std::string(info(*place.channel).stem);
  if (place.from) name += " from " + std::string(info(*place.from).stem);
  return name;
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
  return candidates;
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
