// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tuple>

#include "diagnosis/fitting.h"
#include "diagnosis/instruments.h"
#include "diagnosis/noise_check.h"
#include "diagnosis/preparation.h"
#include "physics/declared_value.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "physics/result_units.h"

namespace stickslip::diagnosis {

namespace {

using physics::Model;

// The instruments of all recordings: those of the largest motion and of every channel.
Model with_instruments_of(Model model, std::span<const Experiment> experiments) {
  Experiment all;
  for (const Experiment& e : experiments) {
    all.period_s = std::max(all.period_s, e.period_s);
    all.compared = static_cast<std::uint8_t>(all.compared | e.compared);
    for (std::size_t c = 0; c < channel_count; ++c) {
      all.noise_std[c] = std::max(all.noise_std[c], e.noise_std[c]);
      all.channel_std[c] = std::max(all.channel_std[c], e.channel_std[c]);
    }
  }
  return with_instruments(std::move(model), all);
}

// Of a number that each recording has its own, a finding holds the mean over the recordings.
void take_means(const std::vector<Comparison>& comparisons, std::vector<Finding>& findings) {
  for (Finding& finding : findings) {
    for (const Comparison& each : comparisons) {
      if (each.number.path != finding.shared.path || each.number.sharing != physics::Sharing::own) {
        continue;
      }
      const std::string name = each.number.path.substr(each.number.path.rfind('.') + 1);
      for (Estimate& estimate : finding.parameters) {
        if (estimate.name != name && !finding.is_number()) continue;
        estimate.value = each.value;
        estimate.low = each.low;
        estimate.high = each.high;
      }
    }
  }
}

CampaignResult campaign_result(const Search& search) {
  const SearchData& data = search.data();
  const FittedCandidate& declared = search.declared();
  const FittedCandidate& result = search.result();
  CampaignResult out{*data.campaign, comparisons_of(data, result), {}, {}};
  for (std::size_t i = 0; i < data.experiments.size(); ++i) {
    out.models.push_back(result.hypothesis->model_in(result.fitted.z, i));
    if (!data.campaign->runs[i].held_out) continue;
    Task own = data.held_out;
    own.windows.clear();
    for (const WindowRef& each : task_for(data.experiments, Use::report, data.threads).windows) {
      if (each.experiment == i) own.windows.push_back(each);
    }
    HeldOutRecording held_out{i, score(own, *declared.hypothesis, declared.fitted.z), {}};
    if (!search.claims().empty()) {
      held_out.augmented = score(own, *result.hypothesis, result.fitted.z);
    }
    out.held_out.push_back(std::move(held_out));
  }
  return out;
}

// The calibrated number that is farthest beyond what the model allows for it; nullptr for none.
const Calibration* contradicted(const Diagnosis& out, const Criteria& criteria) {
  const Calibration* farthest = nullptr;
  for (const Calibration& each : out.calibrated) {
    if (std::abs(each.shift_sigmas) <= criteria.contradicted_sigmas) continue;
    if (farthest == nullptr || std::abs(each.shift_sigmas) > std::abs(farthest->shift_sigmas)) {
      farthest = &each;
    }
  }
  return farthest;
}

Verdict verdict_without_findings(const Search& search, Diagnosis& out) {
  const SearchData& data = search.data();
  const FittedCandidate& declared = search.declared();
  const NoiseCheck check = noise_check(
      windows_for(data, {Use::select, Use::report}), *declared.hypothesis, declared.fitted.z,
      !(out.noise_estimated.empty() && out.noise_level.empty()), data.criteria);
  if (!check.is_noise || contradicted(out, data.criteria) != nullptr) return Verdict::unexplained;
  // The residuals measure the noise better than what raised it before the fit.
  for (const NoiseLevel& found : check.level) {
    const auto raised = std::find_if(out.noise_level.begin(), out.noise_level.end(),
                                     [&](const auto& each) { return each.first == found.channel; });
    if (raised != out.noise_level.end()) {
      raised->second *= found.level;
    } else if (found.differs) {
      out.noise_level.emplace_back(found.channel, found.level);
    }
  }
  return Verdict::consistent;
}

Verdict verdict_of(const Search& search, Diagnosis& out) {
  if (out.findings.empty()) return verdict_without_findings(search, out);
  const double excess_before = search.declared().held_out.chi2 - 1.0;
  const double excess_after = search.result().held_out.chi2 - 1.0;
  const bool explained = (search.is_explained() && !search.is_implausible()) ||
                         excess_after <= search.data().criteria.negligible_share * excess_before;
  return explained ? Verdict::missing_physics : Verdict::unexplained;
}

// The fit of the declared model with chi-squared in units of the noise, whatever its weights were.
Fit residuals_in_noise(const Search& search, const Task& measured) {
  const FittedCandidate& declared = search.declared();
  Fit out = declared.fitted;
  for (std::size_t w = 0; w < measured.windows.size(); ++w) {
    const Experiment& e = measured.experiment(w);
    const Window& window = measured.window(w);
    const auto readings = predict(e, window, window.end, *declared.hypothesis, declared.fitted.z,
                                  declared.fitted.state[w]);
    out.chi2[w] = 0.0;
    for_each_compared(e, window.begin, window.end, [&](std::size_t k, std::size_t c) {
      const double r = (readings[k - window.begin][c] - e.reading[k][c]) / measured.sigma_of(e, c);
      out.chi2[w] += std::min(r * r, 1.0e12);
    });
  }
  return out;
}

Balances balances_for(const std::vector<protocol::Recording>& recordings, const Model& model,
                      const Search& search) {
  const SearchData& data = search.data();
  const FittedCandidate& declared = search.declared();
  const Model calibrated = declared.hypothesis->model_at(declared.fitted.z);
  return balances_of({recordings, data.experiments, model, calibrated, data.campaign.get()},
                     data.seed, data.threads, data.criteria);
}

// Of what has no name: that of the best candidate, unless the balances exclude it.
physics::Relation relation_without_findings(const Search& search, const Balances& balances,
                                            const std::optional<BalanceLocation>& by_balances) {
  const auto relation = search.relation().value_or(physics::Relation::force_balance);
  if (!by_balances || admits(*by_balances, balances, relation, std::nullopt)) return relation;
  return by_balances->relation;
}

Location location_of(const Search& search, const std::vector<Finding>& findings,
                     const Balances& balances) {
  const SearchData& data = search.data();
  Task measured = search.declared_task();
  measured.sigma = noise_sigma(data.experiments);
  const Fit residuals = residuals_in_noise(search, measured);
  const Hypothesis& declared = *search.declared().hypothesis;
  const auto by_balances = location_by(balances, declared.model());
  const auto relation = findings.empty() ? relation_without_findings(search, balances, by_balances)
                                         : findings.front().relation();
  Location location =
      locate(measured, declared, residuals, relation, data.explained_chi2(), data.criteria);
  location.balances = balances;
  location.regions = regions_of(measured, declared, residuals, data.seed, data.criteria);
  if (findings.empty()) {
    if (by_balances && by_balances->channel) location.channel = by_balances->channel;
    return location;
  }
  const Finding& first = findings.front();
  if (first.place.channel) location.channel = first.place.channel;
  if (first.when_s) location.when_s = {*first.when_s};
  const bool admitted =
      !by_balances || std::any_of(findings.begin(), findings.end(), [&](const Finding& each) {
        return admits(*by_balances, balances, each.relation(), each.place.channel);
      });
  if (!admitted) (location.statement += ' ') += contradiction_by(*by_balances, balances);
  return location;
}

bool has_friction(const std::vector<Finding>& findings) {
  return std::any_of(findings.begin(), findings.end(), [](const Finding& each) {
    return each.relation() == physics::Relation::friction_law;
  });
}

Evidence evidence_for(const Search& search) {
  const SearchData& data = search.data();
  Task whole = windows_for(data, {Use::fit, Use::select, Use::report});
  whole.sigma = noise_sigma(data.experiments);
  whole.colour = {};
  FitOptions options;
  options.iterations = 8;
  const FittedCandidate& declared = search.declared();
  const FittedCandidate& result = search.result();
  const Fit before = fit_states(whole, *declared.hypothesis, declared.fitted.z, options);
  const Fit after = fit_states(whole, *result.hypothesis, result.fitted.z, options);
  return evidence_of(whole, {&*declared.hypothesis, before.z, &before.state},
                     {&*result.hypothesis, after.z, &after.state});
}

void set_evidence(const Search& search, Diagnosis& out) {
  out.evidence = evidence_for(search);
  if (!has_friction(out.findings)) return;
  out.friction =
      friction_picture(search.declared(), search.result(), search.data().experiments.front());
}

std::vector<Calibration> calibration_of(const FittedCandidate& result, Model declared) {
  // Terms that were added come last: the declared parameters keep their indices.
  const auto named = physics::parameters_of(declared);
  const auto& unknowns = result.hypothesis->unknowns();
  // Of a number that each recording has its own: the mean, with the interval of the first.
  const std::vector<double> means = result.hypothesis->parameters(result.fitted.z);
  std::vector<Calibration> out;
  for (std::size_t u = 0; u < unknowns.size(); ++u) {
    if (!unknowns[u].of_model || result.hypothesis->unknown_of(unknowns[u].parameter) != u)
      continue;
    const auto& [path, parameter] = named[unknowns[u].parameter];
    Calibration each{path, result.hypothesis->value(u, result.fitted.z[u])};
    if (unknowns[u].recording) each.value = means[unknowns[u].parameter];
    each.shift_sigmas = (each.value - parameter->value) / parameter->sigma;
    each.declared = parameter->value;
    each.sigma = parameter->sigma;
    std::tie(each.low, each.high) = interval_of(result, u);
    if (unknowns[u].recording) {
      const double off = each.value - result.hypothesis->value(u, result.fitted.z[u]);
      each.low += off;
      each.high += off;
    }
    out.push_back(each);
  }
  return out;
}

void set_noise(const Experiment& first, const Task& judged, Diagnosis& out) {
  for (const Channel channel : all_channels) {
    const std::size_t c = index_of(channel);
    if (!(first.noise_std[c] > 0.0)) continue;
    out.noise_std.emplace_back(channel, first.noise_std[c]);
    Noise noise{channel, first.noise_std[c]};
    if (c < predicted_channels && first.is_compared(c)) {
      noise.std = judged.sigma_of(first, c);
      noise.correlation_s = judged.colour[c].correlation_s;
    }
    const double level = first.noise_above_declared[c] * noise.std / first.noise_std[c];
    if (first.noise_above_declared[c] > 1.0 || (first.noise_declared[c] && level != 1.0)) {
      out.noise_level.emplace_back(channel, level);
      noise.source = Noise::Source::contradicted;
    } else if (!first.noise_declared[c]) {
      out.noise_estimated.push_back(channel);
      noise.source = Noise::Source::estimated;
    }
    out.noise.push_back(noise);
  }
}

// A calibration beyond what the model allows for is where the mismatch lives, if nothing else is.
void add_contradiction(Diagnosis& out, const Criteria& criteria) {
  const Calibration* number = contradicted(out, criteria);
  if (number == nullptr) return;
  Location& location = *out.location;
  location.relation = physics::relation_of(number->path, out.model);
  location.statement = physics::contradiction(number->path, number->declared, number->value) +
                       ", " + physics::fixed_text(std::abs(number->shift_sigmas), 1) +
                       " declared standard deviations away. " + location.statement;
}

}  // namespace

std::string_view name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::consistent:
      return "consistent";
    case Verdict::missing_physics:
      return "missing_physics";
    case Verdict::unexplained:
      return "unexplained";
  }
  return "";
}

std::string_view name_of(Noise::Source source) {
  switch (source) {
    case Noise::Source::declared:
      return "declared";
    case Noise::Source::estimated:
      return "estimated";
    case Noise::Source::contradicted:
      return "contradicted";
  }
  return "";
}

void use_units_of_model(Diagnosis& out) {
  const physics::ResultUnits units(out.model);
  const auto rewrite = [&units](std::string& text) { text = units.sentence(std::move(text)); };
  if (out.location) {
    rewrite(out.location->statement);
    for (Region& region : out.location->regions) rewrite(region.words);
  }
  for (Finding& finding : out.findings) {
    rewrite(finding.statement);
    for (Estimate& each : finding.parameters) each.unit = std::string(units.of(each.unit));
    if (finding.separating_experiment) rewrite(*finding.separating_experiment);
    for (std::vector<Curve>* curves : {&finding.shape, &finding.portrait}) {
      for (Curve& curve : *curves) {
        curve.unit = std::string(units.of(curve.unit));
        curve.variable_unit = std::string(units.of(curve.variable_unit));
      }
    }
  }
  for (Integrity& integrity : out.integrity) {
    for (std::string& remark : integrity.remarks) rewrite(remark);
  }
}

Diagnosis diagnose(const std::vector<protocol::Recording>& recordings, const Model& declared_model,
                   const Options& options) {
  if (const std::string words = invalid(options.criteria); !words.empty()) {
    throw std::invalid_argument("criteria: " + words);
  }
  const auto report = [&](const std::string& step, double done) {
    if (options.progress) options.progress(step, done);
  };
  Diagnosis out;
  Prepared prepared = prepare(recordings, declared_model, options);
  const std::vector<Experiment>& experiments = prepared.experiments;
  out.integrity = std::move(prepared.integrity);
  out.horizon_s = prepared.horizon_s;
  out.windows = prepared.windows;
  const Model model = options.campaign ? with_instruments_of(declared_model, experiments)
                                       : with_instruments(declared_model, experiments.front());
  SearchData data = search_data(experiments, options.criteria, options.seed, options.threads);
  data.campaign = options.campaign;
  data.train.stop = data.held_out.stop = options.stop;
  Search search(std::move(data), options.progress);
  search.run(model);
  report("scoring the result", 0.92);
  const FittedCandidate& declared = search.declared();
  const FittedCandidate& result = search.result();
  const Task reported = windows_for(search.data(), {Use::report});
  out.baseline = score(reported, *declared.hypothesis, declared.fitted.z);
  if (!search.claims().empty()) {
    out.augmented = score(reported, *result.hypothesis, result.fitted.z);
  }
  out.findings = findings_of(search, out.horizon_s);
  out.trials = search.trials();
  out.calibrated = calibration_of(result, model);
  set_noise(experiments.front(), reported, out);
  out.model = options.conditions.empty() ? posterior_model(result)
                                         : posterior_model(result, options.conditions);
  out.verdict = verdict_of(search, out);
  if (out.verdict != Verdict::consistent) {
    report("comparing the balances", 0.94);
    out.location = location_of(search, out.findings, balances_for(recordings, model, search));
    if (out.findings.empty()) add_contradiction(out, options.criteria);
  }
  if (options.campaign) {
    report("comparing the recordings", 0.945);
    out.campaign = campaign_result(search);
    take_means(out.campaign->comparisons, out.findings);
  }
  report("computing detection limits", 0.95);
  out.detection = search.detection();
  if (options.evidence) set_evidence(search, out);
  if (options.posterior_axes > 0) {
    out.open_hypotheses = open_hypotheses_of(search, options.posterior_axes, options.seed);
  }
  out.baseline_model = declared.hypothesis->model_at(declared.fitted.z);
  use_units_of_model(out);
  report("done", 1.0);
  return out;
}

}  // namespace stickslip::diagnosis
