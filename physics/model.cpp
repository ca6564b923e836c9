#include "physics/model.h"

#include <cmath>

#include "physics/effects/catalogue.h"

namespace stickslip::physics {

namespace {

void add(std::vector<NamedParameter>& list, const char* path, Parameter& parameter) {
  list.push_back({path, &parameter});
}

void add(std::vector<NamedParameter>& list, const char* path, std::optional<Parameter>& parameter) {
  if (parameter) list.push_back({path, &*parameter});
}

}  // namespace

std::string path_of(const Term& term) {
  std::string path = "physics.";
  path += term.id;
  for (const std::optional<Channel>& channel : {term.channel, term.from}) {
    if (!channel) continue;
    path += '.';
    path += info(*channel).stem;
  }
  return path;
}

std::vector<NamedParameter> parameters_of(Model& model) {
  std::vector<NamedParameter> list;
  if (model.oscillator.excitation != Excitation::imposed) {
    add(list, "oscillator.mass_kg", model.oscillator.mass_kg);
    add(list, "oscillator.natural_frequency_hz", model.oscillator.natural_frequency_hz);
    add(list, "oscillator.stiffness_n_m", model.oscillator.stiffness_n_m);
    add(list, "oscillator.damping_ratio", model.oscillator.damping_ratio);
    add(list, "oscillator.damping_n_s_m", model.oscillator.damping_n_s_m);
    if (model.oscillator.two_well) {
      add(list, "oscillator.two_well.linear_n_m", model.oscillator.two_well->linear_n_m);
      add(list, "oscillator.two_well.cubic_n_m3", model.oscillator.two_well->cubic_n_m3);
    }
  }
  if (model.normal_load && model.normal_load->law != NormalLoadLaw::measured) {
    add(list, "normal_load.load_n", model.normal_load->load_n);
    if (model.normal_load->law == NormalLoadLaw::wedge) {
      add(list, "normal_load.slope_per_m", model.normal_load->slope_per_m);
    }
  }
  if (model.friction.law != FrictionLaw::none) {
    add(list, "friction.mu", model.friction.mu);
    add(list, "friction.transition_speed_m_s", model.friction.transition_speed_m_s);
    if (model.friction.law == FrictionLaw::state_variable) {
      add(list, "friction.rate_per_s", model.friction.rate_per_s);
    }
  }
  if (model.load_cell) {
    add(list, "load_cell.mass_kg", model.load_cell->mass_kg);
    add(list, "load_cell.natural_frequency_hz", model.load_cell->natural_frequency_hz);
    add(list, "load_cell.damping_ratio", model.load_cell->damping_ratio);
  }
  for (Term& term : model.terms) {
    for (auto& [name, parameter] : term.parameters) {
      std::string path = path_of(term);
      path += '.';
      path += name;
      list.push_back({std::move(path), &parameter});
    }
  }
  return list;
}

namespace {

enum class Range { any, not_negative, positive };

class Inspection {
 public:
  void need(bool sound, std::string path, std::string message) {
    if (!sound) found_.push_back({std::move(path), std::move(message)});
  }

  void range(const Parameter& parameter, const std::string& path, Range range) {
    need(std::isfinite(parameter.value), path, "must be a finite number");
    need(std::isfinite(parameter.sigma) && parameter.sigma >= 0.0, path, "sigma must be 0 or more");
    if (range == Range::positive) need(!(parameter.value <= 0.0), path, "must be more than 0");
    if (range == Range::not_negative) need(!(parameter.value < 0.0), path, "must be 0 or more");
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
    inspection.need(!spring && !damper && !oscillator.two_well, "oscillator",
                    "with excitation = \"imposed\" the motion is given: no other key may stand in "
                    "[oscillator]");
    return;
  }
  inspection.range(oscillator.mass_kg, "oscillator.mass_kg", Range::positive);
  inspection.range(oscillator.natural_frequency_hz, "oscillator.natural_frequency_hz",
                   Range::positive);
  inspection.range(oscillator.stiffness_n_m, "oscillator.stiffness_n_m", Range::not_negative);
  inspection.range(oscillator.damping_ratio, "oscillator.damping_ratio", Range::not_negative);
  inspection.range(oscillator.damping_n_s_m, "oscillator.damping_n_s_m", Range::not_negative);
  inspection.need(spring, "oscillator",
                  "lacks its spring: give natural_frequency_hz or stiffness_n_m (0: no spring)");
  inspection.need(!(oscillator.natural_frequency_hz && oscillator.stiffness_n_m),
                  "oscillator.stiffness_n_m",
                  "natural_frequency_hz is given as well: keep one of the two");
  inspection.need(damper, "oscillator",
                  "lacks its damping: give damping_ratio or damping_n_s_m (0: none)");
  inspection.need(!(oscillator.damping_ratio && oscillator.damping_n_s_m),
                  "oscillator.damping_n_s_m",
                  "damping_ratio is given as well: keep one of the two");
  if (oscillator.damping_ratio && !oscillator.natural_frequency_hz && oscillator.stiffness_n_m) {
    inspection.need(oscillator.stiffness_n_m->value > 0.0, "oscillator.damping_ratio",
                    "means nothing without a spring (stiffness_n_m = 0): give damping_n_s_m");
  }
  if (oscillator.two_well) {
    inspection.range(oscillator.two_well->linear_n_m, "oscillator.two_well.linear_n_m",
                     Range::positive);
    inspection.range(oscillator.two_well->cubic_n_m3, "oscillator.two_well.cubic_n_m3",
                     Range::positive);
  }
}

void inspect(const Term& term, const Model& model, Inspection& inspection) {
  const std::string path = path_of(term);
  const Effect* effect = find_effect(term.id);
  if (effect == nullptr) {
    std::string known;
    for (const Effect* each : catalogue()) {
      known += (known.empty() ? "" : ", ") + std::string(each->card().id);
    }
    inspection.need(false, path, "there is no effect \"" + term.id + "\"; there are " + known);
    return;
  }
  const Card& card = effect->card();
  inspection.need(effect->can_be_missing_from(model), path,
                  "\"" + term.id + "\" cannot be added to a model with these laws (" +
                      std::string(card.equation) + ")");
  inspection.need((card.relation == Relation::sensor) == term.channel.has_value(), path,
                  card.relation == Relation::sensor
                      ? "needs the channel that it acts on: channel = \"...\""
                      : "acts on no single channel: remove channel");
  if (term.channel) {
    const bool two = effect->acts_on({term.channel, Channel::displacement}) ||
                     effect->acts_on({term.channel, Channel::velocity});
    inspection.need(two == term.from.has_value(), path,
                    two ? "needs the channel that leaks into it: from = \"...\""
                        : "has no second channel: remove from");
    if (two == term.from.has_value()) {
      inspection.need(effect->acts_on({term.channel, term.from}), path,
                      "cannot act on the channel " + std::string(info(*term.channel).stem) +
                          (two ? " from " + std::string(info(*term.from).stem) : std::string()));
    }
  }
  for (const ParameterCard& parameter : card.parameters) {
    const auto found = term.parameters.find(std::string(parameter.name));
    const std::string at = path + "." + std::string(parameter.name);
    if (found == term.parameters.end()) {
      inspection.need(parameter.fixed_default.has_value(), at,
                      "is missing: " + std::string(parameter.meaning) + " [" +
                          std::string(parameter.unit) + "]");
    } else {
      const bool may_be_zero = parameter.fixed_default == 0.0;
      const Range positive = may_be_zero ? Range::not_negative : Range::positive;
      inspection.range(found->second, at, parameter.positive ? positive : Range::any);
    }
  }
  for (const auto& [name, parameter] : term.parameters) {
    bool known = false;
    for (const ParameterCard& each : card.parameters) known = known || each.name == name;
    inspection.need(known, path + "." + name, "is no parameter of \"" + term.id + "\"");
  }
}

}  // namespace

std::vector<Inconsistency> inconsistencies_of(const Model& model) {
  Inspection inspection;
  inspect(model.oscillator, inspection);
  const bool imposed = model.oscillator.excitation == Excitation::imposed;

  if (model.normal_load && model.normal_load->law != NormalLoadLaw::measured) {
    inspection.range(model.normal_load->load_n, "normal_load.load_n", Range::not_negative);
    if (model.normal_load->law == NormalLoadLaw::wedge) {
      inspection.range(model.normal_load->slope_per_m, "normal_load.slope_per_m", Range::any);
    }
  }
  if (model.friction.law != FrictionLaw::none) {
    inspection.range(model.friction.mu, "friction.mu", Range::not_negative);
    inspection.range(model.friction.transition_speed_m_s, "friction.transition_speed_m_s",
                     Range::not_negative);
    if (model.friction.law == FrictionLaw::state_variable) {
      inspection.range(model.friction.rate_per_s, "friction.rate_per_s", Range::positive);
    }
  }
  if (model.load_cell) {
    inspection.range(model.load_cell->mass_kg, "load_cell.mass_kg", Range::positive);
    inspection.range(model.load_cell->natural_frequency_hz, "load_cell.natural_frequency_hz",
                     Range::positive);
    inspection.range(model.load_cell->damping_ratio, "load_cell.damping_ratio",
                     Range::not_negative);
    inspection.need(!imposed, "load_cell",
                    "has no place where the motion is imposed: friction_force is f itself");
  }
  if (model.normal_load_bridge) {
    const NormalLoadBridge& bridge = *model.normal_load_bridge;
    inspection.need(std::isfinite(bridge.mismatch) && std::abs(bridge.mismatch) < 1.0,
                    "normal_load_bridge.mismatch", "must be more than -1 and less than 1");
    inspection.need(bridge.share >= 0.0 && bridge.share <= 1.0, "normal_load_bridge.share",
                    "must be 0 to 1");
    inspection.need(std::isfinite(bridge.share_slope_per_m), "normal_load_bridge.share_slope_per_m",
                    "must be finite");
    inspection.need(model.normal_load && model.normal_load->law != NormalLoadLaw::measured,
                    "normal_load_bridge", "needs a normal load whose law is not \"measured\"");
  }
  for (Channel channel : all_channels) {
    const Sensor& sensor = model.sensors[index_of(channel)];
    const std::string path = "sensors." + std::string(info(channel).stem);
    if (sensor.noise_std) {
      inspection.need(std::isfinite(*sensor.noise_std) && *sensor.noise_std > 0.0,
                      path + ".noise_std", "must be more than 0 (leave it out where unknown)");
    }
    for (const Filter& filter : sensor.filters) {
      inspection.need(filter.order >= 1 && filter.order <= 8, path + ".filters",
                      "order must be 1 to 8");
      inspection.need(std::isfinite(filter.cutoff_hz) && filter.cutoff_hz > 0.0, path + ".filters",
                      "cutoff_hz must be more than 0");
    }
  }
  Model seen = model;
  for (std::size_t i = 0; i < model.terms.size(); ++i) {
    const Term& term = model.terms[i];
    for (std::size_t j = 0; j < i; ++j) {
      inspection.need(path_of(model.terms[j]) != path_of(term), path_of(term), "stands twice");
    }
    inspect(term, seen, inspection);
    if (const Effect* effect = find_effect(term.id)) effect->mark(seen);
  }
  return inspection.take();
}

}  // namespace stickslip::physics
