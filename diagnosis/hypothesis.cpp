#include "diagnosis/hypothesis.h"

#include <algorithm>
#include <cmath>

namespace stickslip::diagnosis {

using physics::BoundTerm;
using physics::Model;
using physics::Parameter;
using physics::ParameterCard;

namespace {

// Declared positive parameters have no meaning at or below zero: they are kept above a thousandth
// of the declared value.
double admissible(const Unknown& unknown, double value) {
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
    // A factor of e^4, about 50, either way: bounds parameters that the recording does not show.
    unknown.prior_sigma = 4.0;
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
    if (!(parameter.sigma > 0.0)) continue;
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

double Hypothesis::value(std::size_t unknown, double z) const {
  const Unknown& u = unknowns_[unknown];
  return u.logarithmic ? u.centre * std::exp(u.scale * std::clamp(z, -20.0, 20.0))
                       : admissible(u, u.centre + u.scale * z);
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

std::vector<double> values_of(const BoundTerm& term, std::span<const double> values) {
  std::vector<double> out;
  for (std::size_t k = 0; k < term.effect->card().parameters.size(); ++k) {
    out.push_back(term.parameter[k] >= 0 ? values[static_cast<std::size_t>(term.parameter[k])]
                                         : term.fallback[k]);
  }
  return out;
}

}  // namespace stickslip::diagnosis
