#include "diagnosis/hypothesis.h"

#include <algorithm>
#include <cmath>

#include "physics/effects/catalogue.h"

namespace stickslip::diagnosis {

using physics::Model;
using physics::Parameter;

namespace {

// Parameters that lose their meaning at or below zero; they are kept at a small positive share.
double admissible(const Unknown& unknown, double value) {
  return unknown.of_model && unknown.centre > 0.0 ? std::max(value, 1.0e-3 * unknown.centre)
                                                  : value;
}

Unknown unknown_for(const physics::ParameterCard& card, std::size_t parameter, double centre) {
  Unknown unknown;
  unknown.parameter = parameter;
  unknown.centre = centre;
  unknown.refinement = card.fixed_default.has_value();
  if (card.positive) {
    unknown.logarithmic = true;
    // A factor of 50 either way: keeps what cannot be seen from running off.
    unknown.prior_sigma = 4.0;
  }
  if (card.start_sigma > 0.0) unknown.prior_sigma = card.start_sigma;
  return unknown;
}

}  // namespace

Hypothesis::Hypothesis(const Model& model) : Hypothesis(model, {}, model.terms.size()) {}

Hypothesis::Hypothesis(Model model, std::vector<Unknown> of_terms, std::size_t declared_terms)
    : model_(std::move(model)), rig_(model_), declared_terms_(declared_terms) {
  const auto named = physics::parameters_of(model_);
  for (std::size_t i = 0; i < named.size(); ++i) {
    const Parameter& parameter = *named[i].parameter;
    if (!(parameter.sigma > 0.0)) continue;
    unknowns_.push_back({i, parameter.value, parameter.sigma, false, 1.0, true});
  }
  // Terms on trial come after the parameters of the model, in the order in which they were added.
  for (const Unknown& unknown : of_terms) unknowns_.push_back(unknown);
}

std::vector<Unknown> Hypothesis::of_terms() const {
  std::vector<Unknown> terms;
  for (const Unknown& unknown : unknowns_) {
    if (!unknown.of_model) terms.push_back(unknown);
  }
  return terms;
}

Hypothesis Hypothesis::loaded(double factor) const {
  Model model = model_;
  if (model.normal_load) {
    model.normal_load->load_n.value *= factor;
    model.normal_load->load_n.sigma *= factor;
  }
  return {std::move(model), of_terms(), declared_terms_};
}

Hypothesis Hypothesis::with(const physics::Effect& effect, const physics::Place& place,
                            std::span<const double> start, std::span<const double> fixed,
                            Detail detail) const {
  Model model = model_;
  physics::Term term;
  term.id = effect.card().id;
  term.channel = place.channel;
  term.from = place.from;
  const bool whole = start.size() == effect.card().parameters.size();
  std::size_t next_start = 0;
  std::size_t next_fixed = 0;
  for (const physics::ParameterCard& card : effect.card().parameters) {
    const double value =
        card.fixed_default && !whole
            ? (next_fixed < fixed.size() ? fixed[next_fixed++] : *card.fixed_default)
            : start[next_start++];
    term.parameters[std::string(card.name)] = {value, 0.0};
  }
  model.terms.push_back(term);

  // Adding parameters of a term never moves those that stand before it: terms come last.
  std::vector<Unknown> terms = of_terms();
  const auto named = physics::parameters_of(model);
  for (const physics::ParameterCard& card : effect.card().parameters) {
    if (card.fixed_default && (!card.estimated || detail == Detail::coarse)) continue;
    const std::string path = physics::path_of(term) + "." + std::string(card.name);
    const auto at = std::find_if(named.begin(), named.end(),
                                 [&](const auto& each) { return each.path == path; });
    terms.push_back(
        unknown_for(card, static_cast<std::size_t>(at - named.begin()), at->parameter->value));
  }
  return {std::move(model), std::move(terms), declared_terms_};
}

Hypothesis Hypothesis::refined() const {
  Model model = model_;
  const auto named = physics::parameters_of(model);
  std::vector<Unknown> terms = of_terms();
  for (std::size_t t = declared_terms_; t < model.terms.size(); ++t) {
    const physics::Term& term = model.terms[t];
    for (const physics::ParameterCard& card : physics::find_effect(term.id)->card().parameters) {
      if (!card.fixed_default || !card.estimated) continue;
      const std::string path = physics::path_of(term) + "." + std::string(card.name);
      for (std::size_t i = 0; i < named.size(); ++i) {
        const bool known = std::any_of(unknowns_.begin(), unknowns_.end(),
                                       [i](const Unknown& u) { return u.parameter == i; });
        if (named[i].path == path && !known) {
          terms.push_back(unknown_for(card, i, named[i].parameter->value));
        }
      }
    }
  }
  return {std::move(model), std::move(terms), declared_terms_};
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

}  // namespace stickslip::diagnosis
