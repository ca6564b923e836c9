// SPDX-License-Identifier: Apache-2.0
// How far the catalogue's formulas are from the forms that `stickslip conceal` hides: the right
// effect is fitted to recordings of another simulator, whose forms differ (a bristle for a
// compliant contact, five Iwan elements for a hysteresis). What the parameters are off by beyond
// their intervals is ParameterCard::formula_uncertainty, and what the fit leaves is
// Card::formula_residual. For physics that the catalogue does not list it is the shape drawn over
// the quantity that the physics depends on.
//
//   formula_table [--count N] [--seed S] [--duration T] [--effect ID]... [--csv FILE] [--jobs N]
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "diagnosis/finalists.h"
#include "diagnosis/findings.h"
#include "diagnosis/held_out.h"
#include "diagnosis/instruments.h"
#include "diagnosis/parallel/for_each.h"
#include "diagnosis/preparation.h"
#include "tools/concealment/concealment.h"
#include "tools/concealment/hidden_effect.h"

namespace stickslip {
namespace {

using concealment::TrueEffect;
using concealment::TrueParameter;

struct Options {
  std::size_t count = 12;
  std::uint64_t seed = 1;
  double duration_s = 24.0;
  std::vector<std::string> effects;
  std::string csv;
  int jobs = 0;
};

// Of one parameter in one recording, relative to its distance from no effect.
struct Deviation {
  double error = 0.0;  ///< fitted less true
  double sigma = 0.0;  ///< of the fit

  // Of the error, beyond what the fit's own uncertainty accounts for.
  double excess_square() const { return std::max(0.0, error * error - sigma * sigma); }
};

struct FormulaFit {
  std::string name;
  std::string form = {};
  bool claimed = false;  ///< by a diagnosis: it gains more than chance, and explains the recording
  double explained = 0.0;  ///< excess chi-squared per sample without the effect, held out
  double left = 0.0;       ///< with it
  std::map<std::string, Deviation> parameters = {};
};

std::optional<Deviation> deviation_of(const diagnosis::Estimate& estimate,
                                      const TrueParameter& truth) {
  const double distance = truth.value - truth.reference;
  if (!truth.graded || distance == 0.0) return std::nullopt;
  double error = (estimate.value - truth.value) / distance;
  if (truth.sign_free) error = std::abs(estimate.value / truth.value) - 1.0;
  return Deviation{error, (estimate.high - estimate.low) / 3.92 / std::abs(distance)};
}

bool is_same(const diagnosis::CandidateEffect& each, const TrueEffect& truth) {
  return each.effect->card().id == truth.id &&
         (!truth.channel || each.place.channel == truth.channel);
}

bool is_shape_for(const diagnosis::CandidateEffect& each, const TrueEffect& truth) {
  const physics::Card& card = each.effect->card();
  return card.tier == physics::Tier::free_form &&
         physics::name_of(card.relation) == truth.relations.front() &&
         std::ranges::equal(card.depends_on, truth.depends_on);
}

// The declared model with the hidden effect, fitted as a diagnosis would.
FormulaFit fitted(const concealment::Case& hidden, std::uint64_t seed) {
  const TrueEffect& truth = hidden.truth.effects.front();
  FormulaFit out{hidden.truth.name, truth.form};
  const diagnosis::Options options;
  const diagnosis::Prepared prepared =
      diagnosis::prepare({hidden.recording}, hidden.declared, options);
  diagnosis::SearchData data =
      diagnosis::search_data(prepared.experiments, options.criteria, seed, 1);
  const diagnosis::FittedCandidate declared = diagnosis::calibrate(
      data, diagnosis::with_instruments(hidden.declared, prepared.experiments.front()));
  const diagnosis::ResidualFeatures features =
      diagnosis::residual_features(data.train, *declared.hypothesis, declared.fitted);
  const auto is_hidden = [&truth](const diagnosis::CandidateEffect& each) {
    return !each.is_number() &&
           (truth.depends_on.empty() ? is_same(each, truth) : is_shape_for(each, truth));
  };
  std::vector<diagnosis::FittedCandidate> found = diagnosis::finalists(
      data, features, declared, [](const std::string&, double) {}, is_hidden);
  if (found.empty()) return out;
  diagnosis::fit_and_score(data, declared, found);
  diagnosis::restart_best(data, *declared.hypothesis, declared, found,
                          [](const diagnosis::FittedCandidate&) { return true; });
  diagnosis::FittedCandidate& best = *std::ranges::min_element(
      found, {}, [](const diagnosis::FittedCandidate& each) { return each.total_loss(); });
  diagnosis::settle(data, best);
  const diagnosis::HeldOut without = diagnosis::held_out_score(
      data.held_out, *declared.hypothesis, declared.fitted.z, data.noise_is_known);
  out.claimed =
      best.held_out.chi2 < data.explained_chi2() &&
      diagnosis::is_gain(without, best.held_out, data.noise_is_known, options.criteria, 0.0);
  out.explained = without.chi2 - 1.0;
  out.left = best.held_out.chi2 - 1.0;
  for (const diagnosis::Estimate& each : diagnosis::estimates_of(best)) {
    const auto it = truth.parameters.find(each.name);
    if (it == truth.parameters.end()) continue;
    if (const auto deviation = deviation_of(each, it->second))
      out.parameters[each.name] = *deviation;
  }
  return out;
}

// Recording i of an effect depends on the seed and i only.
FormulaFit evaluated(const Options& options, const std::string& effect, std::size_t i) {
  concealment::CaseRequest request;
  request.kind = concealment::find_hidden_effect(effect)->listed
                     ? concealment::CaseRequest::Kind::single
                     : concealment::CaseRequest::Kind::unlisted;
  request.ids = {effect};
  request.duration_s = options.duration_s;
  const std::uint64_t seed = options.seed + i;
  const std::string name = effect + " " + std::to_string(seed);
  try {
    return fitted(concealment::conceal(request, seed, name), seed);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", name.c_str(), error.what());
    return {name, error.what()};
  }
}

double root_mean_excess(const std::vector<Deviation>& all) {
  double sum = 0.0;
  for (const Deviation& each : all) sum += each.excess_square();
  return std::sqrt(sum / static_cast<double>(all.size()));
}

double percent_covered(const std::vector<Deviation>& all, double formula) {
  const auto held = std::ranges::count_if(all, [formula](const Deviation& each) {
    return std::abs(each.error) <= 1.96 * std::hypot(each.sigma, formula);
  });
  return 100.0 * static_cast<double>(held) / static_cast<double>(all.size());
}

void print_row(const std::string& effect, const std::vector<FormulaFit>& fits) {
  std::map<std::string, std::vector<Deviation>> by_parameter;
  std::vector<double> left;
  for (const FormulaFit& each : fits) {
    if (!each.claimed) continue;
    left.push_back(std::max(0.0, each.left) / std::max(each.explained, 1.0e-3));
    for (const auto& [name, deviation] : each.parameters) by_parameter[name].push_back(deviation);
  }
  std::ranges::sort(left);
  const auto share = [&left](double at) {
    return left.empty() ? 0.0
                        : left[static_cast<std::size_t>(at * static_cast<double>(left.size() - 1))];
  };
  if (by_parameter.empty()) {
    std::printf("| `%s` | | %zu | | | | %.2g | %.2g |\n", effect.c_str(), left.size(),
                100.0 * share(0.5), 100.0 * share(0.9));
  }
  for (const auto& [name, all] : by_parameter) {
    const double excess = root_mean_excess(all);
    std::printf("| `%s` | `%s` | %zu | %.2f | %.0f | %.0f | %.2g | %.2g |\n", effect.c_str(),
                name.c_str(), all.size(), 100.0 * excess, percent_covered(all, 0.0),
                percent_covered(all, excess), 100.0 * share(0.5), 100.0 * share(0.9));
  }
  std::fflush(stdout);
}

void write_rows(std::ofstream& csv, const std::string& effect,
                const std::vector<FormulaFit>& fits) {
  for (const FormulaFit& each : fits) {
    for (const auto& [name, deviation] : each.parameters) {
      csv << effect << ',' << each.name << ",\"" << each.form << "\"," << each.claimed << ','
          << name << ',' << deviation.error << ',' << deviation.sigma << ',' << each.explained
          << ',' << each.left << '\n';
    }
    if (each.parameters.empty()) {
      csv << effect << ',' << each.name << ",\"" << each.form << "\"," << each.claimed << ",,,,"
          << each.explained << ',' << each.left << '\n';
    }
  }
  csv.flush();
}

void run(const Options& options) {
  std::ofstream csv;
  if (!options.csv.empty()) {
    csv.open(options.csv);
    csv << "effect,recording,form,claimed,parameter,error,sigma,explained,left\n";
  }
  std::printf(
      "| effect | parameter | recordings | formula, 1 SD, %% | in ci95, %% | with formula, %% | "
      "left, median, %% | left, 90 %% |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n");
  for (const std::string& effect : options.effects) {
    std::vector<FormulaFit> fits(options.count);
    parallel::for_each(options.count, parallel::threads_for(options.jobs),
                       [&](std::size_t i) { fits[i] = evaluated(options, effect, i); });
    print_row(effect, fits);
    if (csv.is_open()) write_rows(csv, effect, fits);
  }
}

std::vector<std::string> effects() {
  std::vector<std::string> out;
  for (const concealment::HiddenEffect& each : concealment::hidden_effects()) {
    out.emplace_back(each.id);
  }
  return out;
}

}  // namespace
}  // namespace stickslip

int main(int argc, char** argv) {
  stickslip::Options options;
  options.effects = stickslip::effects();
  CLI::App app(
      "Errors of the catalogue's formulas on concealed recordings, as a table in Markdown.");
  app.add_option("--count", options.count, "recordings of each effect")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--seed", options.seed, "of the first recording")->capture_default_str();
  app.add_option("--duration", options.duration_s, "least duration of a recording [s]")
      ->check(CLI::Range(5.0, 3600.0))
      ->capture_default_str();
  app.add_option("--effect", options.effects, "only these")->check(CLI::IsMember(options.effects));
  app.add_option("--csv", options.csv, "file for one row per parameter and recording");
  app.add_option("--jobs", options.jobs, "threads; 0: one per core")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    stickslip::run(options);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
