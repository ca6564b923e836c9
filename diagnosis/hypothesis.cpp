// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/hypothesis.h"

#include <algorithm>
#include <cmath>

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

physics::Term term_of(const physics::Effect& effect, const physics::Place& place,
                      std::span<const double> start, std::span<const double> fixed) {
  physics::Term term;
  term.id = effect.card().id;
  term.channel = place.channel;
  term.from = place.from;
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

Hypothesis::Hypothesis(const Model& model) : Hypothesis(model, {}, model.terms.size()) {}

Hypothesis::Hypothesis(Model model, std::vector<Unknown> trial_unknowns, std::size_t declared_terms)
    : model_(std::move(model)), rig_(model_), declared_terms_(declared_terms) {
  const auto named = physics::parameters_of(model_);
  for (std::size_t i = 0; i < named.size(); ++i) {
    const Parameter& parameter = *named[i].parameter;
    const auto is_freed = [i](const Unknown& each) { return each.freed && each.parameter == i; };
    if (!(parameter.sigma > 0.0)) continue;
    if (std::any_of(trial_unknowns.begin(), trial_unknowns.end(), is_freed)) continue;
    unknowns_.push_back({i, parameter.value, parameter.sigma, false, 1.0, true});
  }
  // Terms come last in a model: those on trial follow its parameters in the order of their
  // addition.
  for (const Unknown& unknown : trial_unknowns) unknowns_.push_back(unknown);
}

std::vector<Unknown> Hypothesis::trial_unknowns() const {
  std::vector<Unknown> trial;
  for (const Unknown& unknown : unknowns_) {
    if (!unknown.of_model) trial.push_back(unknown);
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
  return {std::move(model), trial_unknowns(), declared_terms_};
}

Hypothesis Hypothesis::with(const physics::Effect& effect, const physics::Place& place,
                            std::span<const double> start, std::span<const double> fixed,
                            Detail detail) const {
  Model model = model_;
  model.terms.push_back(term_of(effect, place, start, fixed));
  Hypothesis extended(std::move(model), trial_unknowns(), declared_terms_);
  const BoundTerm& term = extended.rig_.terms().back();
  const auto& cards = effect.card().parameters;
  for (std::size_t k = 0; k < cards.size(); ++k) {
    if (cards[k].fixed_default && (!cards[k].estimated || detail == Detail::coarse)) continue;
    const int index = term.parameter[k];
    extended.unknowns_.push_back(unknown_for(
        cards[k], index, extended.rig_.parameter_values()[static_cast<std::size_t>(index)]));
  }
  return extended;
}

Hypothesis Hypothesis::freeing(std::size_t parameter) const {
  const std::string& path = rig_.parameter_paths()[parameter];
  Unknown unknown;
  unknown.parameter = parameter;
  unknown.centre = rig_.parameter_values()[parameter];
  unknown.freed = true;
  const bool positive = !physics::is_signed(path);
  unknown.logarithmic = positive && unknown.centre > 0.0;
  unknown.not_negative = positive;
  if (unknown.logarithmic) unknown.prior_sigma = wide_log_sigma;
  std::vector<Unknown> trial = trial_unknowns();
  trial.push_back(unknown);
  return {model_, std::move(trial), declared_terms_};
}

Hypothesis Hypothesis::holding(std::span<const std::size_t> parameters) const {
  Model model = model_;
  const auto named = physics::parameters_of(model);
  for (const std::size_t each : parameters) named[each].parameter->sigma = 0.0;
  return {std::move(model), trial_unknowns(), declared_terms_};
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
  return {std::move(out), trial_unknowns(), declared_terms_};
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
      out.unknowns_.push_back(
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

std::vector<double> Hypothesis::parameters(std::span<const double> z) const {
  std::vector<double> values = rig_.parameter_values();
  for (std::size_t i = 0; i < unknowns_.size(); ++i)
    values[unknowns_[i].parameter] = value(i, z[i]);
  return values;
}

Model Hypothesis::model_at(std::span<const double> z) const {
  Model model = model_;
  const auto named = physics::parameters_of(model);
  for (std::size_t i = 0; i < unknowns_.size(); ++i) {
    named[unknowns_[i].parameter].parameter->value = value(i, z[i]);
  }
  return model;
}

std::vector<double> carried_over(const Hypothesis& from, std::span<const double> z,
                                 const Hypothesis& to) {
  std::vector<double> out(to.unknowns().size(), 0.0);
  for (std::size_t u = 0; u < z.size(); ++u) {
    const auto same = to.unknown_of(from.unknowns()[u].parameter);
    if (!same) continue;
    const Unknown& a = from.unknowns()[u];
    const Unknown& b = to.unknowns()[*same];
    const bool alike = a.centre == b.centre && a.scale == b.scale && a.logarithmic == b.logarithmic;
    out[*same] = alike ? z[u] : to.z_of(*same, from.value(u, z[u]));
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
