// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/findings.h"

#include <algorithm>
#include <cmath>

#include "diagnosis/line_source.h"
#include "diagnosis/selection.h"
#include "diagnosis/separation.h"
#include "physics/declared_value.h"
#include "physics/friction_laws.h"

namespace stickslip::diagnosis {

namespace {

// An unknown that is a parameter of an effect, by its position on the effect's card.
struct OwnUnknown {
  std::size_t unknown = 0;
  std::size_t position = 0;
};

// In the order of the card.
std::vector<OwnUnknown> own_unknowns(const FittedCandidate& each) {
  std::vector<OwnUnknown> out;
  for (const OwnParameter& own : own_indices(each)) {
    if (own.index < 0) continue;
    const auto unknown = each.hypothesis->unknown_of(static_cast<std::size_t>(own.index));
    if (unknown) out.push_back({*unknown, own.position});
  }
  return out;
}

// Standard deviation of a parameter from the accuracy of its effect's formula.
double deviation_of_formula(const physics::ParameterCard& card, double value) {
  return card.formula_uncertainty * std::abs(value - card.neutral);
}

double deviation_of_formula(const FittedCandidate& each, const OwnUnknown& own) {
  return deviation_of_formula(each.candidate.effect->card().parameters[own.position],
                              each.hypothesis->value(own.unknown, each.fitted.z[own.unknown]));
}

// Of both together, in z.
double standard_deviation(const FittedCandidate& each, const OwnUnknown& own) {
  const double slope = each.hypothesis->slope(own.unknown, each.fitted.z[own.unknown]);
  return std::hypot(each.fitted.standard_deviation(own.unknown),
                    deviation_of_formula(each, own) / std::max(std::abs(slope), 1.0e-300));
}

// Standard deviation of every number of the rig from the formula of its effect.
std::vector<double> formula_uncertainties(const Hypothesis& hypothesis,
                                          const std::vector<double>& values) {
  std::vector<double> out(values.size(), 0.0);
  for (const physics::BoundTerm& term : hypothesis.trial_terms()) {
    const auto& cards = term.effect->card().parameters;
    for (std::size_t k = 0; k < cards.size(); ++k) {
      if (term.parameter[k] < 0) continue;
      const auto index = static_cast<std::size_t>(term.parameter[k]);
      out[index] = deviation_of_formula(cards[k], values[index]);
    }
  }
  return out;
}

Finding with_parameters(const FittedCandidate& each) {
  Finding finding{each.candidate};
  finding.parameters = estimates_of(each);
  finding.statement = statement_of(each);
  return finding;
}

Eigen::MatrixXd correlation_of(const FittedCandidate& each, const std::vector<OwnUnknown>& own,
                               const std::vector<double>& sigma) {
  const Eigen::MatrixXd& covariance = each.fitted.covariance;
  const auto n = static_cast<Eigen::Index>(own.size());
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      if (i == j) continue;
      const auto a = static_cast<std::size_t>(i);
      const auto b = static_cast<std::size_t>(j);
      const auto u = static_cast<Eigen::Index>(own[a].unknown);
      const auto v = static_cast<Eigen::Index>(own[b].unknown);
      const double of_fit = covariance(u, v) / std::sqrt(covariance(u, u) * covariance(v, v));
      correlation(i, j) = of_fit * each.fitted.standard_deviation(own[a].unknown) *
                          each.fitted.standard_deviation(own[b].unknown) / (sigma[a] * sigma[b]);
    }
  }
  return correlation;
}

// The fitted effect as curves, with the bands that follow from all of its parameters.
std::vector<Curve> portrait_with_bands(const FittedCandidate& each, const Experiment& experiment) {
  const Hypothesis& hypothesis = *each.hypothesis;
  const physics::Model model = hypothesis.model_at(each.fitted.z);
  const double friction_n = physics::friction_coefficient(model).value *
                            (model.normal_load ? experiment.mean_load_n : 1.0);
  const auto fitted = own_parameters(each);
  const auto portrait = [&](const std::vector<double>& values) {
    return portrait_of(*each.candidate.effect, each.candidate.place, values, fitted, experiment,
                       friction_n);
  };
  const std::vector<OwnUnknown> own = own_unknowns(each);
  std::vector<double> sigma;
  for (const OwnUnknown& unknown : own) {
    sigma.push_back(std::max(standard_deviation(each, unknown), 1.0e-300));
  }
  std::vector<Curve> curves = portrait(fitted);
  add_bands(curves, correlation_of(each, own, sigma), [&](Eigen::Index i, double by) {
    const auto k = static_cast<std::size_t>(i);
    const std::size_t u = own[k].unknown;
    std::vector<double> values = fitted;
    values[own[k].position] = hypothesis.value(u, each.fitted.z[u] + by * sigma[k]);
    return portrait(values);
  });
  return curves;
}

// Begin and end, within the recording, of an effect that does not last.
std::optional<std::pair<double, double>> episode_of(const FittedCandidate& each,
                                                    const Experiment& experiment) {
  const auto& episode = each.candidate.effect->card().episode;
  if (!episode) return std::nullopt;
  const auto values = own_parameters(each);
  const double last_s = experiment.duration_s();
  return std::pair{experiment.start_s + std::clamp(values[episode->begin_s], 0.0, last_s),
                   experiment.start_s + std::clamp(values[episode->end_s], 0.0, last_s)};
}

// The run that would separate the first of `rivals` from the most probable other: the best
// simulated variation, or, where none separates them, the experiment on the effect's card.
std::string experiment_between(const std::vector<FittedCandidate>& rivals,
                               const std::vector<double>& weight, const SearchData& data,
                               double horizon_s) {
  std::size_t other = 1;
  for (std::size_t k = 2; k < rivals.size(); ++k) {
    if (weight[k] > weight[other]) other = k;
  }
  const auto separation = separation_of(data.experiments.front(),
                                        {&*rivals.front().hypothesis, rivals.front().fitted.z},
                                        {&*rivals[other].hypothesis, rivals[other].fitted.z},
                                        horizon_s, data.seed, data.threads, data.criteria);
  return separation ? sentence_of(*separation)
                    : std::string(rivals.front().candidate.effect->card().experiment);
}

Finding finding_of(const Search& search, const Claim& claim, std::size_t number, double horizon_s) {
  const SearchData& data = search.data();
  const Criteria& criteria = data.criteria;
  const Experiment& first = data.experiments.front();
  FittedCandidate claimed = search.result();
  claimed.candidate = claim.candidate;
  Finding finding = with_parameters(claimed);
  finding.chi2_before = claim.before.chi2;
  finding.chi2_after = claim.after.chi2;
  finding.gain = claim.gain;
  const auto weight = probabilities(claim.rivals, criteria, data.seed + number);
  finding.probability = weight.front();
  for (std::size_t k = 1; k < weight.size(); ++k) {
    if (weight[k] < criteria.least_alternative_probability) continue;
    finding.alternatives.push_back({claim.rivals[k].candidate, weight[k]});
    if (weight[k] > weight.front()) finding.preferred_over.push_back(claim.rivals[k].candidate);
  }
  if (claim.candidate.is_number() && search.claims().size() == 1 && search.is_explained()) {
    finding.statement.replace(finding.statement.size() - 1, 1, "; with it the model fits.");
  }
  finding.when_s = episode_of(claimed, first);
  if (!claim.candidate.is_number()) {
    finding.shape = shape_of(*finding.effect, own_parameters(claimed), first);
    finding.portrait = portrait_with_bands(claimed, first);
  }
  if (finding.probability < criteria.certain_probability && !finding.alternatives.empty()) {
    finding.separating_experiment = experiment_between(claim.rivals, weight, data, horizon_s);
  }
  return finding;
}

}  // namespace

std::vector<Finding> findings_of(const Search& search, double horizon_s) {
  std::vector<Finding> findings;
  for (const Claim& claim : search.claims()) {
    findings.push_back(finding_of(search, claim, findings.size(), horizon_s));
  }
  add_line_sources(search.data().experiments.front(), findings);
  return findings;
}

std::vector<Estimate> estimates_of(const FittedCandidate& each) {
  const CandidateEffect& candidate = each.candidate;
  const std::vector<double> values = own_parameters(each);
  std::vector<Estimate> out;
  for (const OwnUnknown& own : own_unknowns(each)) {
    const physics::ParameterCard& card = candidate.effect->card().parameters[own.position];
    const auto [low, high] = interval_of(each, own.unknown);
    out.push_back(
        {std::string(card.name), values[own.position], low, high, deviation_of_formula(each, own),
         candidate.is_number() ? physics::unit_of(candidate.parameter, each.hypothesis->model())
                               : physics::unit_at(card.unit, candidate.place),
         each.fitted.is_determined(own.unknown)});
  }
  return out;
}

physics::Model posterior_model(const FittedCandidate& each) {
  const Hypothesis& hypothesis = *each.hypothesis;
  physics::Model model = hypothesis.model_at(each.fitted.z);
  const auto named = physics::parameters_of(model);
  const std::vector<double> formula =
      formula_uncertainties(hypothesis, hypothesis.parameters(each.fitted.z));
  for (std::size_t u = 0; u < hypothesis.unknowns().size(); ++u) {
    const auto i = static_cast<Eigen::Index>(u);
    if (i >= each.fitted.covariance.rows()) break;
    if (hypothesis.unknowns()[u].part != Part::level) continue;
    const std::size_t index = hypothesis.unknowns()[u].parameter;
    physics::Parameter& parameter = *named[index].parameter;
    const double of_fit =
        std::abs(hypothesis.slope(u, each.fitted.z[u])) * each.fitted.standard_deviation(u);
    const double sigma = std::hypot(of_fit, formula[index]);
    if (std::isfinite(sigma)) parameter.sigma = sigma;
  }
  return model;
}

physics::Model posterior_model(const FittedCandidate& each,
                               const std::map<std::string, double>& conditions) {
  physics::Model model = posterior_model(each);
  physics::Run run;
  run.conditions = conditions;
  physics::Model under = each.hypothesis->model_at(each.fitted.z, run);
  const auto from = physics::parameters_of(under);
  const auto to = physics::parameters_of(model);
  for (std::size_t i = 0; i < to.size(); ++i) {
    physics::Parameter& parameter = *to[i].parameter;
    // The relative error of a coefficient is that of the number.
    if (parameter.value != 0.0) {
      parameter.sigma *= std::abs(from[i].parameter->value / parameter.value);
    }
    parameter.value = from[i].parameter->value;
  }
  return model;
}

std::pair<double, double> interval_of(const FittedCandidate& each, std::size_t unknown) {
  const double z = each.fitted.z[unknown];
  const double half = each.fitted.half_width_95(unknown);
  return std::minmax(each.hypothesis->value(unknown, z - half),
                     each.hypothesis->value(unknown, z + half));
}

}  // namespace stickslip::diagnosis
