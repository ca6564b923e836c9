// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tuple>

#include "diagnosis/channel_faults.h"
#include "diagnosis/fitting.h"
#include "diagnosis/instruments.h"
#include "diagnosis/noise_check.h"
#include "diagnosis/outliers.h"
#include "physics/declared_value.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "physics/result_units.h"

namespace stickslip::diagnosis {

namespace {

using physics::Model;

// The recordings with their windows, integrated with fine and with coarse steps.
struct Experiments {
  std::vector<Experiment> fine;
  std::vector<Experiment> coarse;
};

std::size_t& count_of(Use use, WindowCount& windows) {
  switch (use) {
    case Use::fit:
      break;
    case Use::select:
      return windows.select;
    case Use::report:
      return windows.report;
  }
  return windows.fit;
}

Experiments prepare(const std::vector<protocol::Recording>& recordings, const Model& model,
                    const Options& options, Diagnosis& out) {
  Experiments experiments;
  for (const protocol::Recording& recording : recordings) {
    experiments.fine.push_back(make_experiment(recording, model));
    refuse_faulty_channels(Cleaned(recording).recording(), model);
    experiments.coarse.push_back(make_experiment(recording, model, Steps::coarse));
    out.integrity.push_back(integrity_of(recording, model, options.criteria));
  }
  out.horizon_s = options.horizon_s.value_or(default_horizon_s(model, experiments.fine.front()));
  for (Experiment& e : experiments.coarse) cut_windows(e, model, out.horizon_s);
  for (Experiment& e : experiments.fine) {
    cut_windows(e, model, out.horizon_s);
    for (const Window& window : e.windows) ++count_of(window.use, out.windows);
  }
  const WindowCount& windows = out.windows;
  if (std::min(windows.fit, windows.select) < 2 || windows.report == 0) {
    throw InputError(Problem{recordings.front().source, 0, 0,
                             "is too short: it gives " + physics::counted(windows.fit, "window") +
                                 " of " + physics::number_text(out.horizon_s) + " s to fit, " +
                                 std::to_string(windows.select) + " to select a model, and " +
                                 std::to_string(windows.report) +
                                 " to report; 2, 2 and 1 are needed"});
  }
  return experiments;
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

// All windows of those uses, in units of the noise by which hypotheses were judged.
Task windows_for(const SearchData& data, std::initializer_list<Use> uses) {
  Task out = data.held_out;
  out.windows.clear();
  for (const Use use : uses) {
    const Task each = task_for(data.experiments, use, data.threads);
    out.windows.insert(out.windows.end(), each.windows.begin(), each.windows.end());
  }
  return out;
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
  const bool explained =
      (search.is_explained() && !search.is_implausible()) ||
      excess_after <= search.data().criteria.explained_excess_share * excess_before;
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
      const double r = (readings[k - window.begin][c] - e.reading[k][c]) / measured.sigma[c];
      out.chi2[w] += std::min(r * r, 1.0e12);
    });
  }
  return out;
}

Location location_of(const Search& search, const std::vector<Finding>& findings) {
  const SearchData& data = search.data();
  Task measured = search.declared_task();
  measured.sigma = noise_sigma(data.experiments);
  const Fit residuals = residuals_in_noise(search, measured);
  const Hypothesis& declared = *search.declared().hypothesis;
  const auto relation = findings.empty()
                            ? search.relation().value_or(physics::Relation::force_balance)
                            : findings.front().candidate().relation();
  Location location =
      locate(measured, declared, residuals, relation, data.explained_chi2(), data.criteria);
  location.regions = regions_of(measured, declared, residuals, data.seed, data.criteria);
  if (findings.empty()) return location;
  const Finding& first = findings.front();
  if (first.place.channel) location.channel = first.place.channel;
  if (first.when_s) location.when_s = {*first.when_s};
  return location;
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

std::vector<Calibration> calibration_of(const FittedCandidate& result, Model declared) {
  // Terms that were added come last: the declared parameters keep their indices.
  const auto named = physics::parameters_of(declared);
  const auto& unknowns = result.hypothesis->unknowns();
  std::vector<Calibration> out;
  for (std::size_t u = 0; u < unknowns.size(); ++u) {
    if (!unknowns[u].of_model) continue;
    const auto& [path, parameter] = named[unknowns[u].parameter];
    Calibration each{path, result.hypothesis->value(u, result.fitted.z[u])};
    each.shift_sigmas = (each.value - parameter->value) / parameter->sigma;
    each.declared = parameter->value;
    each.sigma = parameter->sigma;
    std::tie(each.low, each.high) = interval_of(result, u);
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
    if (first.noise_above_declared[c] > 1.0) {
      out.noise_level.emplace_back(channel, first.noise_above_declared[c]);
      noise.source = Noise::Source::contradicted;
    } else if (!first.noise_declared[c]) {
      out.noise_estimated.push_back(channel);
      noise.source = Noise::Source::estimated;
    }
    if (first.is_compared(c) && c < predicted_channels && !judged.colour[c].is_white()) {
      noise.std = judged.sigma[c];
      noise.correlation_s = judged.colour[c].correlation_s;
    }
    out.noise.push_back(noise);
  }
}

// A calibration beyond what the model allows for is where the mismatch lives, if nothing else is.
void add_contradiction(Diagnosis& out, const Criteria& criteria) {
  const Calibration* number = contradicted(out, criteria);
  if (number == nullptr) return;
  Location& location = *out.location;
  location.relation = physics::relation_of(number->path);
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
  const Experiments experiments = prepare(recordings, declared_model, options, out);
  const Model model = with_instruments(declared_model, experiments.fine.front());
  Search search(search_data(experiments.fine, experiments.coarse, options.criteria, options.seed,
                            options.threads),
                options.progress);
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
  set_noise(experiments.fine.front(), reported, out);
  out.verdict = verdict_of(search, out);
  if (out.verdict != Verdict::consistent) {
    out.location = location_of(search, out.findings);
    if (out.findings.empty()) add_contradiction(out, options.criteria);
  }
  report("computing detection limits", 0.95);
  out.detection = search.detection();
  if (options.evidence) out.evidence = evidence_for(search);
  out.model = posterior_model(result);
  out.baseline_model = declared.hypothesis->model_at(declared.fitted.z);
  use_units_of_model(out);
  report("done", 1.0);
  return out;
}

}  // namespace stickslip::diagnosis
