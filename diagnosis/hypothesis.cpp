// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/hypothesis.h"

#include <algorithm>
#include <cmath>

#include "physics/catalogue.h"
#include "physics/declared_value.h"

namespace stickslip::diagnosis {

using physics::BoundTerm;
using physics::Model;
using physics::Parameter;
using physics::ParameterCard;

namespace {

// A factor of e^4, about 50, either way: bounds parameters that the recording does not show.
constexpr double wide_log_sigma = 4.0;

// Declared positive parameters have no meaning at or below zero: they are kept above a thousandth
// of the declared value. A freed one that was declared as 0 may become 0 again.
double admissible(const Unknown& unknown, double value) {
  if (unknown.not_negative) return std::max(value, 0.0);
  return unknown.of_model && unknown.centre > 0.0 ? std::max(value, 1.0e-3 * unknown.centre)
                                                  : value;
}

Unknown unknown_for(const ParameterCard& card, int parameter, double centre) {
  Unknown unknown;
  unknown.parameter = static_cast<std::size_t>(parameter);
  unknown.centre = centre;
  unknown.refinement = card.fixed_default.has_value();
  if (card.positive) {
    unknown.logarithmic = true;
    unknown.prior_sigma = wide_log_sigma;
  }
  if (card.start_sigma > 0.0) unknown.prior_sigma = card.start_sigma;
  return unknown;
}

// A start derived from a magnitude that is 0 in the recording, such as the friction of a model with
// mu = 0, may lie outside the domain of its parameter.
double in_domain(const ParameterCard& card, double value) {
  const bool inside = std::isfinite(value) && (!card.positive || value > 0.0);
  return inside ? value : std::max(card.low, card.neutral);
}

physics::Term started(const physics::Effect& effect, const physics::Place& place,
                      std::span<const double> start, std::span<const double> fixed) {
  physics::Term term = physics::term_of(effect, place);
  const bool complete = start.size() == effect.card().parameters.size();
  std::size_t next_start = 0;
  std::size_t next_fixed = 0;
  for (const ParameterCard& card : effect.card().parameters) {
    const double value =
        card.fixed_default && !complete
            ? (next_fixed < fixed.size() ? fixed[next_fixed++] : *card.fixed_default)
            : start[next_start++];
    term.parameters[std::string(card.name)] = {in_domain(card, value), 0.0};
  }
  return term;
}

}  // namespace

Hypothesis::Hypothesis(const Model& model, std::shared_ptr<const physics::Campaign> campaign)
    : Hypothesis(model, {}, model.terms.size(), {std::move(campaign), {}}) {}

Hypothesis::Hypothesis(Model model, std::vector<Unknown> trial_unknowns, std::size_t declared_terms,
                       Runs runs)
    : model_(std::move(model)),
      rig_(model_),
      runs_(std::move(runs)),
      declared_terms_(declared_terms) {
  if (campaign() && runs_.setting.empty()) {
    for (const physics::Run& run : campaign()->runs) runs_.setting.push_back(settings(run));
  }
  const auto named = physics::parameters_of(model_);
  for (std::size_t i = 0; i < named.size(); ++i) {
    const Parameter& parameter = *named[i].parameter;
    const auto is_freed = [i](const Unknown& each) { return each.freed && each.parameter == i; };
    if (!(parameter.sigma > 0.0)) continue;
    if (std::any_of(trial_unknowns.begin(), trial_unknowns.end(), is_freed)) continue;
    add({i, parameter.value, parameter.sigma, false, 1.0, true});
  }
  // Terms come last in a model: those on trial follow its parameters in the order of their
  // addition.
  for (const Unknown& unknown : trial_unknowns) unknowns_.push_back(unknown);
}

std::vector<Hypothesis::Setting> Hypothesis::settings(const physics::Run& run) const {
  std::vector<Setting> out;
  for (const auto& [path, value] : physics::settings_of(run, model_)) {
    const auto& paths = rig_.parameter_paths();
    const auto at =
        static_cast<std::size_t>(std::find(paths.begin(), paths.end(), path) - paths.begin());
    if (at == paths.size()) continue;
    const double declared = rig_.parameter_values()[at];
    // A relative error of a positive number is common to all of its settings.
    const bool relative = declared > 0.0 && !physics::is_signed(path, model_);
    out.push_back({at, relative ? value / declared : 1.0, relative ? 0.0 : value - declared});
  }
  return out;
}

// The unknown, or those that it is in a campaign that does not have the number in common.
void Hypothesis::add(const Unknown& unknown) {
  if (!campaign()) {
    unknowns_.push_back(unknown);
    return;
  }
  const auto& all = campaign()->runs;
  const physics::SharedNumber shared =
      campaign()->sharing_of(rig_.parameter_paths()[unknown.parameter]);
  Unknown level = unknown;
  for (const physics::Run& run : all) {
    if (physics::has_coefficient(shared)) level.factor.push_back(campaign()->factor(shared, run));
  }
  const auto of_recording = [&](std::size_t recording, Part part) {
    Unknown own = level;
    own.part = part;
    own.recording = recording;
    own.weight.assign(all.size(), 0.0);
    own.weight[recording] = 1.0;
    return own;
  };
  if (shared.sharing == physics::Sharing::own) {
    for (std::size_t i = 0; i < all.size(); ++i) {
      unknowns_.push_back(of_recording(i, Part::level));
    }
    return;
  }
  unknowns_.push_back(level);
  // A departure from the level is no declared number, and has no prior of the level's.
  Unknown departure = unknown;
  departure.of_model = departure.freed = false;
  departure.prior_sigma = 0.0;
  if (shared.sharing == physics::Sharing::varies) {
    for (std::size_t i = 0; i < all.size(); ++i) {
      Unknown deviation = of_recording(i, Part::deviation);
      deviation.of_model = deviation.freed = false;
      deviation.prior_sigma = shared.spread;
      unknowns_.push_back(std::move(deviation));
    }
  } else if (physics::follows(shared.sharing) && shared.sharing != physics::Sharing::proportional) {
    departure.part = Part::slope;
    for (const physics::Run& run : all) {
      departure.weight.push_back(campaign()->weight(shared, run));
    }
    unknowns_.push_back(std::move(departure));
  }
}

// The last unknown, added as a common one, as the campaign shares it. A freed number takes the
// place of the declared unknown first.
void Hypothesis::share_last() {
  const Unknown last = std::move(unknowns_.back());
  unknowns_.pop_back();
  add(last);
}

std::vector<Unknown> Hypothesis::trial_unknowns() const {
  std::vector<Unknown> trial;
  for (const Unknown& unknown : unknowns_) {
    // Departures from a declared level come and go with it.
    const bool declared = unknowns_[*unknown_of(unknown.parameter)].of_model;
    if (!declared) trial.push_back(unknown);
  }
  return trial;
}

bool Hypothesis::is_unknown(int parameter) const {
  return std::any_of(unknowns_.begin(), unknowns_.end(), [parameter](const Unknown& unknown) {
    return unknown.parameter == static_cast<std::size_t>(parameter);
  });
}

Hypothesis Hypothesis::with_load_factor(double factor) const {
  Model model = model_;
  if (model.normal_load) {
    model.normal_load->load_n.value *= factor;
    model.normal_load->load_n.sigma *= factor;
  }
  return {std::move(model), trial_unknowns(), declared_terms_, runs_};
}

Hypothesis Hypothesis::sharing(const physics::SharedNumber& number) const {
  Runs runs{std::make_shared<physics::Campaign>(campaign()->with(number)), runs_.setting};
  std::vector<Unknown> kept;
  std::optional<Unknown> changed;
  for (Unknown& each : trial_unknowns()) {
    if (rig_.parameter_paths()[each.parameter] != number.path) {
      kept.push_back(std::move(each));
    } else if (!changed) {
      changed = std::move(each);
    }
  }
  if (!changed) return {model_, std::move(kept), declared_terms_, std::move(runs)};
  changed->recording.reset();
  changed->weight.clear();
  changed->factor.clear();
  kept.push_back(*changed);
  Hypothesis out(model_, std::move(kept), declared_terms_, std::move(runs));
  out.share_last();
  return out;
}

Hypothesis Hypothesis::with(const physics::Effect& effect, const physics::Place& place,
                            std::span<const double> start, std::span<const double> fixed,
                            Detail detail) const {
  Model model = model_;
  model.terms.push_back(started(effect, place, start, fixed));
  Hypothesis extended(std::move(model), trial_unknowns(), declared_terms_, runs_);
  const BoundTerm& term = extended.rig_.terms().back();
  const auto& cards = effect.card().parameters;
  for (std::size_t k = 0; k < cards.size(); ++k) {
    if (cards[k].fixed_default && (!cards[k].estimated || detail == Detail::coarse)) continue;
    const int index = term.parameter[k];
    extended.add(unknown_for(cards[k], index,
                             extended.rig_.parameter_values()[static_cast<std::size_t>(index)]));
  }
  return extended;
}

Hypothesis Hypothesis::freeing(std::size_t parameter) const {
  const std::string& path = rig_.parameter_paths()[parameter];
  Unknown unknown;
  unknown.parameter = parameter;
  unknown.centre = rig_.parameter_values()[parameter];
  unknown.freed = true;
  const bool positive = !physics::is_signed(path, model_);
  unknown.logarithmic = positive && unknown.centre > 0.0;
  unknown.not_negative = positive;
  if (unknown.logarithmic) unknown.prior_sigma = wide_log_sigma;
  std::vector<Unknown> trial = trial_unknowns();
  std::erase_if(trial, [&](const Unknown& each) { return each.parameter == parameter; });
  trial.push_back(unknown);
  Hypothesis out(model_, std::move(trial), declared_terms_, runs_);
  out.share_last();
  return out;
}

Hypothesis Hypothesis::holding(std::span<const std::size_t> parameters) const {
  Model model = model_;
  const auto named = physics::parameters_of(model);
  for (const std::size_t each : parameters) named[each].parameter->sigma = 0.0;
  return {std::move(model), trial_unknowns(), declared_terms_, runs_};
}

Hypothesis Hypothesis::with_uncertainties_of(const Model& model) const {
  Model declared = model;
  Model out = model_;
  const auto from = physics::parameters_of(declared);
  const auto to = physics::parameters_of(out);
  // Terms on trial come last.
  for (std::size_t i = 0; i < std::min(from.size(), to.size()); ++i) {
    to[i].parameter->sigma = from[i].parameter->sigma;
  }
  return {std::move(out), trial_unknowns(), declared_terms_, runs_};
}

std::vector<std::size_t> Hypothesis::instruments_beyond(std::span<const double> z,
                                                        double most) const {
  std::vector<std::size_t> out;
  for (std::size_t u = 0; u < unknowns_.size(); ++u) {
    const std::string& path = rig_.parameter_paths()[unknowns_[u].parameter];
    if (unknowns_[u].of_model && path.starts_with("sensors.") && std::abs(z[u]) > most) {
      out.push_back(unknowns_[u].parameter);
    }
  }
  return out;
}

std::optional<std::size_t> Hypothesis::unknown_of(std::size_t parameter) const {
  for (std::size_t u = 0; u < unknowns_.size(); ++u) {
    if (unknowns_[u].parameter == parameter) return u;
  }
  return std::nullopt;
}

Hypothesis Hypothesis::refined() const {
  Hypothesis out = *this;
  for (const BoundTerm& term : trial_terms()) {
    const auto& cards = term.effect->card().parameters;
    for (std::size_t k = 0; k < cards.size(); ++k) {
      const int index = term.parameter[k];
      if (!cards[k].fixed_default || !cards[k].estimated || is_unknown(index)) continue;
      out.add(
          unknown_for(cards[k], index, rig_.parameter_values()[static_cast<std::size_t>(index)]));
    }
  }
  return out;
}

bool Hypothesis::predicts(Channel channel) const {
  const physics::Structure& structure = rig_.structure();
  switch (channel) {
    case Channel::displacement:
    case Channel::velocity:
      return structure.excitation != physics::Excitation::imposed;
    case Channel::friction_force:
      return true;
    case Channel::normal_load:
      return structure.load_law != physics::NormalLoadLaw::measured;
    default:
      return false;
  }
}

double Hypothesis::value(std::size_t unknown, double z) const {
  const Unknown& u = unknowns_[unknown];
  return u.logarithmic ? u.centre * std::exp(u.scale * std::clamp(z, -20.0, 20.0))
                       : admissible(u, u.centre + u.scale * z);
}

double Hypothesis::z_of(std::size_t unknown, double value) const {
  const Unknown& u = unknowns_[unknown];
  if (!u.logarithmic) return (value - u.centre) / u.scale;
  return value / u.centre > 0.0 ? std::log(value / u.centre) / u.scale : 0.0;
}

double Hypothesis::slope(std::size_t unknown, double z) const {
  const Unknown& u = unknowns_[unknown];
  return u.logarithmic ? u.scale * value(unknown, z) : u.scale;
}

// The weighted sum of the unknowns of a number, of which `first` is the first.
double Hypothesis::z_in(std::size_t first, std::span<const double> z, std::size_t recording) const {
  double sum = 0.0;
  for (std::size_t u = first; u < unknowns_.size(); ++u) {
    const Unknown& each = unknowns_[u];
    if (each.parameter != unknowns_[first].parameter) continue;
    sum += each.weight.empty() ? z[u] : each.weight[recording] * z[u];
  }
  return sum;
}

// Of the level, or the mean of those of all recordings.
double Hypothesis::common_z(std::size_t first, std::span<const double> z) const {
  if (!unknowns_[first].recording) return z[first];
  double sum = 0.0;
  for (std::size_t u = first; u < unknowns_.size(); ++u) {
    if (unknowns_[u].parameter == unknowns_[first].parameter) sum += z[u];
  }
  return sum / static_cast<double>(recordings());
}

std::vector<double> Hypothesis::parameters(std::span<const double> z) const {
  std::vector<double> values = rig_.parameter_values();
  for (std::size_t i = 0; i < unknowns_.size(); ++i) {
    if (unknown_of(unknowns_[i].parameter) != i) continue;
    values[unknowns_[i].parameter] = value(i, common_z(i, z));
  }
  return values;
}

std::vector<double> Hypothesis::parameters(std::span<const double> z, std::size_t recording) const {
  if (!campaign()) return parameters(z);
  std::vector<double> values = rig_.parameter_values();
  for (std::size_t i = 0; i < unknowns_.size(); ++i) {
    const Unknown& unknown = unknowns_[i];
    if (unknown_of(unknown.parameter) != i) continue;
    const double factor = unknown.factor.empty() ? 1.0 : unknown.factor[recording];
    values[unknown.parameter] = factor * value(i, z_in(i, z, recording));
  }
  for (const Setting& each : runs_.setting[recording]) {
    values[each.parameter] = each.factor * values[each.parameter] + each.shift;
  }
  return values;
}

bool Hypothesis::acts(std::size_t unknown, std::size_t recording) const {
  const auto& weight = unknowns_[unknown].weight;
  return weight.empty() || weight[recording] != 0.0;
}

double Hypothesis::slope(std::size_t unknown, std::span<const double> z,
                         std::size_t recording) const {
  if (!campaign()) return slope(unknown, z[unknown]);
  const Unknown& u = unknowns_[unknown];
  const std::size_t first = *unknown_of(u.parameter);
  double out = slope(first, z_in(first, z, recording));
  if (!u.weight.empty()) out *= u.weight[recording];
  if (!unknowns_[first].factor.empty()) out *= unknowns_[first].factor[recording];
  for (const Setting& each : runs_.setting[recording]) {
    if (each.parameter == u.parameter) out *= each.factor;
  }
  return out;
}

Model Hypothesis::model_at(std::span<const double> z) const {
  Model model = model_;
  const auto named = physics::parameters_of(model);
  const auto values = parameters(z);
  for (const Unknown& each : unknowns_) {
    named[each.parameter].parameter->value = values[each.parameter];
  }
  return model;
}

Model Hypothesis::model_in(std::span<const double> z, std::size_t recording) const {
  Model model = model_;
  const auto named = physics::parameters_of(model);
  const auto values = parameters(z, recording);
  for (std::size_t i = 0; i < named.size(); ++i) named[i].parameter->value = values[i];
  return model;
}

Model Hypothesis::model_at(std::span<const double> z, const physics::Run& run) const {
  Model model = model_at(z);
  if (!campaign()) return model;
  const auto named = physics::parameters_of(model);
  for (std::size_t u = 0; u < unknowns_.size(); ++u) {
    const Unknown& unknown = unknowns_[u];
    const physics::SharedNumber shared =
        campaign()->sharing_of(rig_.parameter_paths()[unknown.parameter]);
    const std::size_t first = *unknown_of(unknown.parameter);
    double& value_of_number = named[unknown.parameter].parameter->value;
    if (unknown.part == Part::slope) {
      value_of_number = value(first, z[first] + campaign()->weight(shared, run) * z[u]);
    } else if (u == first && !unknown.factor.empty()) {
      value_of_number *= campaign()->factor(shared, run);
    }
  }
  for (const Setting& each : settings(run)) {
    double& value_of_number = named[each.parameter].parameter->value;
    value_of_number = each.factor * value_of_number + each.shift;
  }
  return model;
}

std::vector<double> carried_over(const Hypothesis& from, std::span<const double> z,
                                 const Hypothesis& to) {
  std::vector<double> out(to.unknowns().size(), 0.0);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Unknown& b = to.unknowns()[i];
    const auto first = from.unknown_of(b.parameter);
    if (!first) continue;
    for (std::size_t u = *first; u < z.size(); ++u) {
      const Unknown& a = from.unknowns()[u];
      if (a.parameter != b.parameter || a.part != b.part) continue;
      const bool alike =
          a.centre == b.centre && a.scale == b.scale && a.logarithmic == b.logarithmic;
      if (a.recording == b.recording) {
        out[i] = alike ? z[u] : to.z_of(i, from.value(u, z[u]));
        break;
      }
      // A level that is common in one of them, and each recording's own in the other.
      if (b.part == Part::level) {
        const double common = from.parameters(z)[b.parameter];
        out[i] = to.z_of(i, common);
      }
    }
  }
  return out;
}

std::vector<double> values_of(const BoundTerm& term, std::span<const double> values) {
  std::vector<double> out;
  for (std::size_t k = 0; k < term.effect->card().parameters.size(); ++k) {
    out.push_back(term.parameter[k] >= 0 ? values[static_cast<std::size_t>(term.parameter[k])]
                                         : term.fallback[k]);
  }
  return out;
}

}  // namespace stickslip::diagnosis
