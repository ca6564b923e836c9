// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/candidates.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "physics/catalogue.h"
#include "physics/declared_value.h"
#include "physics/formula_effect.h"

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

// Within a recording, or between those of a campaign.
bool load_differs(const physics::Model& model, const physics::Campaign* campaign) {
  if (!model.normal_load) return false;
  if (model.normal_load->law != physics::NormalLoadLaw::constant) return true;
  if (campaign == nullptr) return false;
  const auto conditions = campaign->varied_conditions();
  return std::find(conditions.begin(), conditions.end(), "load_n") != conditions.end();
}

}  // namespace

std::string CandidateEffect::name() const {
  std::string name(effect->card().id);
  if (is_number()) name += " of " + parameter;
  if (place.channel) name += " of " + std::string(info(*place.channel).stem);
  if (place.from) name += " from " + std::string(info(*place.from).stem);
  if (physics::follows(shared.sharing)) name += " with " + shared.condition;
  if (shared.sharing == physics::Sharing::own) name += " in each recording";
  return name;
}

physics::Relation CandidateEffect::relation() const {
  return is_number() ? number_enters : effect->card().relation;
}

std::vector<CandidateEffect> candidate_effects(const physics::Model& model,
                                               std::span<const Experiment> experiments,
                                               const physics::Campaign* campaign) {
  std::vector<CandidateEffect> candidates;
  const bool varied_load = load_differs(model, campaign);
  const auto add = [&](const physics::Effect* effect, const physics::Place& place) {
    const physics::Card& card = effect->card();
    if (!physics::can_be_missing(*effect, model, place)) return;
    if (card.shows_by_load && !varied_load) return;
    candidates.push_back({effect, place});
    if (!campaign || campaign->runs.size() < 2 || !card.episode || !card.strength) return;
    // It lasts in one recording: in the others its strength is another one, or none.
    candidates.back().shared = {physics::path_of(physics::term_of(*effect, place)) + "." +
                                    std::string(card.parameters[*card.strength].name),
                                physics::Sharing::own};
  };
  const auto catalogue = physics::catalogue();
  std::vector<const physics::Effect*> effects(catalogue.begin(), catalogue.end());
  for (const physics::Term& own : model.candidates) effects.push_back(own.formula.get());
  for (const physics::Effect* effect : effects) {
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
    const physics::Relation relation = physics::relation_of(path, model);
    candidates.push_back({&physics::declared_value(), {}, std::move(path), relation});
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

std::vector<physics::SharedNumber> differences_of(const std::string& path,
                                                  const physics::Campaign& campaign) {
  if (campaign.runs.size() < 2) return {};
  std::vector<std::string> conditions = campaign.varied_conditions();
  std::vector<physics::SharedNumber> out{{path, physics::Sharing::own}};
  // Of two recordings, a number of each follows every condition: that is one hypothesis.
  const bool two = std::ranges::count(campaign.runs, false, &physics::Run::held_out) == 2;
  if (two && std::ranges::any_of(conditions, [](const auto& each) { return each != "order"; })) {
    std::erase(conditions, "order");
    out.clear();
  }
  for (const std::string& condition : conditions) {
    const bool positive =
        std::all_of(campaign.runs.begin(), campaign.runs.end(),
                    [&](const physics::Run& run) { return run.conditions.at(condition) > 0.0; });
    // Degrees Celsius, and the order of the recordings, have no zero of their own.
    const bool has_zero = positive && !condition.ends_with("_c") && condition != "order";
    out.push_back({path, has_zero ? physics::Sharing::power : physics::Sharing::linear, condition});
  }
  return out;
}

std::vector<CandidateEffect> comparison_candidates(const physics::Model& model,
                                                   std::span<const Experiment> experiments,
                                                   const physics::Campaign& campaign) {
  std::vector<CandidateEffect> out;
  if (campaign.runs.size() < 2) return out;
  for (const CandidateEffect& each : candidate_effects(model, experiments)) {
    const bool instrument = !each.is_number() && each.frees_what_is_declared();
    if (!each.is_number() && !instrument) continue;
    const std::string path =
        each.is_number() ? each.parameter
                         : physics::path_of(physics::term_of(*each.effect, each.place)) + "." +
                               std::string(each.effect->card().parameters.front().name);
    // A load that is stated for each recording does not follow itself.
    if (path == "normal_load.load_n") continue;
    if (campaign.sharing_of(path).sharing != physics::Sharing::common) continue;
    // An instrument is another one in one run, and no function of what the rig undergoes.
    auto differences = instrument ? std::vector{physics::SharedNumber{path, physics::Sharing::own}}
                                  : differences_of(path, campaign);
    for (physics::SharedNumber& difference : differences) {
      out.push_back(each);
      out.back().shared = std::move(difference);
    }
  }
  return out;
}

physics::Tier tier_of(const CandidateEffect& candidate) { return candidate.effect->card().tier; }

double formula_residual(const CandidateEffect& candidate) {
  return candidate.is_number() ? 0.0 : candidate.effect->card().formula_residual;
}

std::size_t strength_in(const physics::Card& card, std::size_t size) {
  const std::size_t strength = card.strength.value();
  if (size == card.parameters.size()) return strength;
  const auto first = card.parameters.begin();
  return static_cast<std::size_t>(
      std::count_if(first, first + static_cast<std::ptrdiff_t>(strength),
                    [](const physics::ParameterCard& each) { return !each.fixed_default; }));
}

bool are_rivals(const CandidateEffect& one, const CandidateEffect& other) {
  const auto lists = [](const physics::Card& card, const physics::Card& rival) {
    return std::find(card.rivals.begin(), card.rivals.end(), rival.id) != card.rivals.end();
  };
  const physics::Card& a = one.effect->card();
  const physics::Card& b = other.effect->card();
  return lists(a, b) || lists(b, a);
}

}  // namespace stickslip::diagnosis
