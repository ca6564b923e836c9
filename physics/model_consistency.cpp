// SPDX-License-Identifier: Apache-2.0
#include "physics/model_consistency.h"
#include "physics/reading.h"

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "physics/catalogue.h"
#include "physics/formula_effect.h"
#include "physics/rig.h"

namespace stickslip::physics {

namespace {

enum class Range { any, not_negative, positive };

class Inspection {
 public:
  void require(bool condition, std::string path, std::string message) {
    if (!condition) found_.push_back({std::move(path), std::move(message)});
  }

  void range(const Parameter& parameter, const std::string& path, Range range) {
    require(std::isfinite(parameter.value), path, "must be a finite number");
    require(std::isfinite(parameter.sigma) && parameter.sigma >= 0.0, path,
            "sigma must be 0 or more");
    if (range == Range::positive) require(!(parameter.value <= 0.0), path, "must be more than 0");
    if (range == Range::not_negative) require(!(parameter.value < 0.0), path, "must be 0 or more");
  }
  void range(const std::optional<Parameter>& parameter, const std::string& path, Range kind) {
    if (parameter) range(*parameter, path, kind);
  }

  std::vector<Inconsistency> take() { return std::move(found_); }

 private:
  std::vector<Inconsistency> found_;
};

void inspect(const Oscillator& oscillator, Inspection& inspection) {
  const bool spring = oscillator.natural_frequency_hz || oscillator.stiffness_n_m;
  const bool damper = oscillator.damping_ratio || oscillator.damping_n_s_m;
  if (oscillator.excitation == Excitation::imposed) {
    inspection.require(!spring && !damper && !oscillator.two_well, "oscillator",
                       "with excitation = \"imposed\" the motion is given: remove all other keys "
                       "from [oscillator]");
    return;
  }
  inspection.range(oscillator.mass_kg, "oscillator.mass_kg", Range::positive);
  inspection.range(oscillator.natural_frequency_hz, "oscillator.natural_frequency_hz",
                   Range::positive);
  inspection.range(oscillator.stiffness_n_m, "oscillator.stiffness_n_m", Range::not_negative);
  inspection.range(oscillator.damping_ratio, "oscillator.damping_ratio", Range::not_negative);
  inspection.range(oscillator.damping_n_s_m, "oscillator.damping_n_s_m", Range::not_negative);
  inspection.require(spring, "oscillator",
                     "has no spring: give natural_frequency_hz or stiffness_n_m (0: no spring)");
  inspection.require(!(oscillator.natural_frequency_hz && oscillator.stiffness_n_m),
                     "oscillator.stiffness_n_m",
                     "natural_frequency_hz is given as well: keep one of the two");
  inspection.require(damper, "oscillator",
                     "has no damping: give damping_ratio or damping_n_s_m (0: none)");
  inspection.require(!(oscillator.damping_ratio && oscillator.damping_n_s_m),
                     "oscillator.damping_n_s_m",
                     "damping_ratio is given as well: keep one of the two");
  if (oscillator.damping_ratio && !oscillator.natural_frequency_hz && oscillator.stiffness_n_m) {
    inspection.require(oscillator.stiffness_n_m->value > 0.0, "oscillator.damping_ratio",
                       "is undefined without a spring (stiffness_n_m = 0): give damping_n_s_m");
  }
  if (oscillator.two_well) {
    inspection.range(oscillator.two_well->linear_n_m, "oscillator.two_well.linear_n_m",
                     Range::positive);
    inspection.range(oscillator.two_well->cubic_n_m3, "oscillator.two_well.cubic_n_m3",
                     Range::positive);
  }
}

void inspect(const NormalLoad& load, Inspection& inspection) {
  if (load.law == NormalLoadLaw::measured) return;
  inspection.range(load.load_n, "normal_load.load_n", Range::not_negative);
  if (load.law == NormalLoadLaw::wedge) {
    inspection.range(load.slope_per_m, "normal_load.slope_per_m", Range::any);
  }
}

void inspect(const Friction& friction, Inspection& inspection) {
  if (friction.law == FrictionLaw::none) return;
  inspection.range(friction.mu, "friction.mu", Range::not_negative);
  inspection.range(friction.transition_speed_m_s, "friction.transition_speed_m_s",
                   Range::not_negative);
  if (friction.law == FrictionLaw::state_variable) {
    inspection.range(friction.rate_per_s, "friction.rate_per_s", Range::positive);
  }
}

void inspect(const LoadCell& cell, bool imposed, Inspection& inspection) {
  inspection.range(cell.mass_kg, "load_cell.mass_kg", Range::positive);
  inspection.range(cell.natural_frequency_hz, "load_cell.natural_frequency_hz", Range::positive);
  inspection.range(cell.damping_ratio, "load_cell.damping_ratio", Range::not_negative);
  inspection.require(!imposed, "load_cell",
                     "does not apply to imposed motion: friction_force is f itself");
}

void inspect(const NormalLoadBridge& bridge, const std::optional<NormalLoad>& load,
             Inspection& inspection) {
  inspection.require(std::isfinite(bridge.mismatch) && std::abs(bridge.mismatch) < 1.0,
                     "normal_load_bridge.mismatch", "must be more than -1 and less than 1");
  inspection.require(bridge.share >= 0.0 && bridge.share <= 1.0, "normal_load_bridge.share",
                     "must be 0 to 1");
  inspection.require(std::isfinite(bridge.share_slope_per_m),
                     "normal_load_bridge.share_slope_per_m", "must be finite");
  inspection.require(load && load->law != NormalLoadLaw::measured, "normal_load_bridge",
                     "needs a normal load whose law is not \"measured\"");
}

void inspect(const Sensor& sensor, const std::string& path, Inspection& inspection) {
  if (sensor.noise_std) {
    inspection.require(std::isfinite(*sensor.noise_std) && *sensor.noise_std > 0.0,
                       path + ".noise_std", "must be more than 0 (leave it out where unknown)");
  }
  if (sensor.noise_correlation_s) {
    inspection.require(
        std::isfinite(*sensor.noise_correlation_s) && *sensor.noise_correlation_s >= 0.0,
        path + ".noise_correlation_s", "must be 0 (white) or more");
  }
  if (sensor.gain) {
    inspection.require(std::isfinite(sensor.gain->value) && sensor.gain->value != 0.0,
                       path + ".gain", "must not be 0");
  }
  if (sensor.delay_s) {
    inspection.require(std::abs(sensor.delay_s->value) <= longest_delay_s, path + ".delay_s",
                       "must be at most 0.03 s either way");
  }
  for (const Filter& filter : sensor.filters) {
    inspection.require(filter.order >= 1 && filter.order <= 8, path + ".filters",
                       "order must be 1 to 8");
    inspection.require(std::isfinite(filter.cutoff_hz.value) && filter.cutoff_hz.value > 0.0,
                       path + ".filters", "cutoff_hz must be more than 0");
  }
}

void inspect_place(const Term& term, const Effect& effect, const std::string& path,
                   Inspection& inspection) {
  const bool sensor = effect.card().relation == Relation::sensor;
  inspection.require(sensor == term.channel.has_value(), path,
                     sensor ? "needs the channel that it acts on: channel = \"...\""
                            : "does not act on a single channel: remove channel");
  if (!term.channel) return;
  const bool two = effect.acts_on({term.channel, Channel::displacement}) ||
                   effect.acts_on({term.channel, Channel::velocity});
  inspection.require(two == term.from.has_value(), path,
                     two ? "needs the source of the crosstalk: from = \"...\""
                         : "has no second channel: remove from");
  if (two != term.from.has_value()) return;
  inspection.require(effect.acts_on({term.channel, term.from}), path,
                     "cannot act on the channel " + std::string(info(*term.channel).stem) +
                         (two ? " from " + std::string(info(*term.from).stem) : std::string()));
}

void inspect_parameters(const Term& term, std::span<const ParameterCard> cards,
                        const std::string& path, Inspection& inspection) {
  for (const ParameterCard& card : cards) {
    const auto found = term.parameters.find(std::string(card.name));
    const std::string at = path + "." + std::string(card.name);
    if (found == term.parameters.end()) {
      inspection.require(
          card.fixed_default.has_value(), at,
          "is missing: " + std::string(card.meaning) + " [" + std::string(card.unit) + "]");
    } else {
      const bool may_be_zero = card.fixed_default == 0.0;
      const Range positive = may_be_zero ? Range::not_negative : Range::positive;
      inspection.range(found->second, at, card.positive ? positive : Range::any);
    }
  }
  for (const auto& [name, parameter] : term.parameters) {
    bool known = false;
    for (const ParameterCard& card : cards) known = known || card.name == name;
    inspection.require(known, path + "." + name, "is not a parameter of \"" + term.id + "\"");
  }
}

// `model`: its laws as amended by the terms before this one.
void inspect(const Term& term, const Model& model, Inspection& inspection) {
  const std::string path = path_of(term);
  const Effect* effect = effect_of(term);
  if (effect == nullptr) {
    const std::string meant = nearest_effect(term.id);
    inspection.require(false, path,
                       "there is no effect \"" + term.id + "\"" +
                           (meant.empty() ? "; section 6 of docs/formats.md lists them"
                                          : ": did you mean \"" + meant + "\"?"));
    return;
  }
  const Card& card = effect->card();
  inspection.require(effect->can_be_missing_from(model), path,
                     "\"" + term.id + "\" cannot be added to a model with these laws (" +
                         std::string(card.equation) + ")");
  inspect_place(term, *effect, path, inspection);
  inspect_parameters(term, card.parameters, path, inspection);
}

bool has_own_characteristic(const Term& term) {
  const Effect* effect = effect_of(term);
  return effect != nullptr && effect->card().relation == Relation::sensor &&
         has_own_characteristic(*effect, {term.channel, term.from});
}

// A rig has room for a fixed number of terms and of their states.
void inspect_room(const Model& model, Inspection& inspection) {
  constexpr auto most = static_cast<std::size_t>(max_terms);
  inspection.require(model.terms.size() <= most, "physics",
                     "has " + std::to_string(model.terms.size()) + " terms; expected at most " +
                         std::to_string(most));
  int states = 0;
  for (const Term& term : model.terms) {
    const Effect* effect = effect_of(term);
    const bool fitted = states <= max_term_states;
    if (effect != nullptr) states += effect->state_count();
    inspection.require(!fitted || states <= max_term_states, path_of(term),
                       "is one term too many with states of its own: expected at most " +
                           std::to_string(max_term_states) + " such states in one model");
  }
}

void inspect_terms(const Model& model, Inspection& inspection) {
  inspect_room(model, inspection);
  Model amended = model;
  for (std::size_t i = 0; i < model.terms.size(); ++i) {
    const Term& term = model.terms[i];
    for (std::size_t j = 0; j < i; ++j) {
      const Term& earlier = model.terms[j];
      inspection.require(path_of(earlier) != path_of(term), path_of(term), "is given twice");
      inspection.require(earlier.channel != term.channel || earlier.id == term.id ||
                             !has_own_characteristic(earlier) || !has_own_characteristic(term),
                         path_of(term),
                         "cannot be combined with \"" + earlier.id + "\" on one channel");
    }
    inspect(term, amended, inspection);
    const Effect* own = effect_of(term);
    inspection.require(own == nullptr || !is_in_law(*own, model), path_of(term),
                       "is in the law of [friction] already: remove one of the two");
    if (const Effect* effect = effect_of(term)) effect->amend(amended);
  }
}

void inspect_candidates(const Model& model, Inspection& inspection) {
  for (std::size_t i = 0; i < model.candidates.size(); ++i) {
    const Term& candidate = model.candidates[i];
    const std::string path = "candidate." + candidate.id;
    inspection.require(candidate.formula != nullptr, path, "needs a formula");
    inspection.require(!candidate.parameters.empty(), path,
                       "needs a parameter: a diagnosis estimates how large the effect is");
    for (std::size_t j = 0; j < i; ++j) {
      inspection.require(model.candidates[j].id != candidate.id, path, "is given twice");
    }
  }
}

}  // namespace

std::vector<Inconsistency> inconsistencies_of(const Model& model) {
  Inspection inspection;
  inspect(model.oscillator, inspection);
  if (model.normal_load) inspect(*model.normal_load, inspection);
  inspect(model.friction, inspection);
  const bool imposed = model.oscillator.excitation == Excitation::imposed;
  if (model.load_cell) inspect(*model.load_cell, imposed, inspection);
  if (model.normal_load_bridge) {
    inspect(*model.normal_load_bridge, model.normal_load, inspection);
  }
  for (Channel channel : all_channels) {
    inspect(model.sensors[index_of(channel)], "sensors." + std::string(info(channel).stem),
            inspection);
  }
  inspect_terms(model, inspection);
  inspect_candidates(model, inspection);
  return inspection.take();
}

}  // namespace stickslip::physics
