// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/laws.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "diagnosis/finalists.h"
#include "diagnosis/fitting.h"
#include "diagnosis/instruments.h"
#include "diagnosis/parallel/for_each.h"
#include "diagnosis/preparation.h"
#include "diagnosis/residual_features.h"
#include "diagnosis/selection.h"
#include "diagnosis/separation.h"
#include "physics/catalogue.h"
#include "physics/friction_laws.h"

namespace stickslip::diagnosis {

namespace {

using physics::Model;

// Of a first fit from one start. Laws have more parameters than an effect, and all of them matter:
// without the damping of its bristles, for example, fits of LuGre's law end elsewhere.
constexpr int start_iterations = 12;

// The rig without its law of friction, and without the terms that change that law.
Model without_friction(Model model) {
  model.friction = {};
  std::erase_if(model.terms, [](const physics::Term& term) {
    return physics::effect_of(term)->card().relation == physics::Relation::friction_law;
  });
  return model;
}

double declared_transition_m_s(const Model& model) {
  if (model.friction.law != physics::FrictionLaw::none) {
    return model.friction.transition_speed_m_s.value;
  }
  const physics::Term* law = physics::law_term(model);
  if (law == nullptr) return 0.0;
  const auto& position = physics::effect_of(*law)->card().transition_speed;
  if (!position) return 0.0;
  const auto& cards = physics::effect_of(*law)->card().parameters;
  const auto found = law->parameters.find(std::string(cards[*position].name));
  return found == law->parameters.end() ? 0.0 : found->second.value;
}

physics::Scales scales_for(const SearchData& data, const FittedCandidate& none,
                           const Model& declared) {
  const Experiment& e = data.experiments.front();
  const std::vector<double> origin(none.fitted.z.size(), 0.0);
  physics::Scales scales = scales_of(data.experiments, *none.hypothesis, origin, {}, {});
  scales.friction_n =
      physics::friction_coefficient(declared).value * (declared.normal_load ? e.mean_load_n : 1.0);
  if (!(scales.friction_n > 0.0) && e.is_compared(index_of(Channel::friction_force))) {
    scales.friction_n = 0.7 * e.largest.friction_n;
  }
  if (!declared.normal_load) scales.mean_load_n = 1.0;
  scales.transition_speed_m_s = declared_transition_m_s(declared);
  return scales;
}

// The law fitted to some of the windows from its best start, with states for all of them. It begins
// at the declared values: a rig without friction leads them astray.
FittedCandidate from_best_start(const SearchData& data, const WindowSubset& subset,
                                const Hypothesis& none, const physics::Effect& law,
                                const physics::Scales& scales) {
  FittedCandidate best;
  best.candidate = {&law, {}};
  for (const std::vector<double>& start : law.starts(scales)) {
    const Hypothesis hypothesis = none.with(law, {}, start, {}, Detail::all);
    const std::vector<double> origin(hypothesis.unknowns().size(), 0.0);
    Fit fitted =
        fit_in_stages(subset.task, hypothesis, origin, initial_states(subset.task, hypothesis),
                      brief_fit(start_iterations));
    if (best.hypothesis && !(fitted.cost < best.fitted.cost)) continue;
    best.hypothesis = hypothesis;
    best.fitted = std::move(fitted);
  }
  std::vector<WindowState> states = initial_states(data.train, *best.hypothesis);
  for (std::size_t i = 0; i < subset.window.size(); ++i) {
    states[subset.window[i]] = best.fitted.state[i];
  }
  best.fitted.state = std::move(states);
  return best;
}

class LawFits {
 public:
  LawFits(SearchData data, const Options& options, const Model& declared)
      : data_(std::move(data)), options_(options), declared_(declared) {}

  void run(const Model& model) {
    report("fitting the rig without friction", 0.0);
    none_ = calibrate(data_, without_friction(model));
    fit_laws();
    // The noise is what the best law leaves: all are weighed by it.
    report("weighing by the noise", 0.6);
    FittedCandidate& best = *std::min_element(
        laws_.begin(), laws_.end(), [](const FittedCandidate& a, const FittedCandidate& b) {
          return a.total_loss() < b.total_loss();
        });
    settle(data_, best);
    none_.held_out =
        held_out_score(data_.held_out, *none_.hypothesis, none_.fitted.z, data_.noise_is_known);
    for (FittedCandidate& each : laws_) converge(each);
    rank_laws();
  }

  const SearchData& data() const { return data_; }
  /// The preferred law first.
  const std::vector<FittedCandidate>& laws() const { return laws_; }
  double probability(std::size_t law) const { return probability_[law]; }
  bool is_determined(const FittedCandidate& each) const {
    return each.candidate.effect == nullptr || diagnosis::is_determined(each, data_.criteria);
  }
  bool is_distinguished(const FittedCandidate& each) const {
    const ScoreGain gain = score_gain(each.held_out, laws_.front().held_out);
    return gain.value > data_.criteria.preference_errors * gain.se && gain.value > 0.0;
  }

 private:
  void report(const std::string& step, double done) const {
    if (options_.progress) options_.progress(step, done);
  }

  void converge(FittedCandidate& each) const { fit_and_score(data_, none_, {&each, 1}); }

  void fit_laws() {
    const auto list = physics::friction_laws();
    const WindowSubset subset = window_subset(data_, none_);
    const physics::Scales scales = scales_for(data_, none_, declared_);
    laws_.resize(list.size());
    report("fitting " + std::to_string(list.size()) + " laws", 0.05);
    parallel::for_each(list.size(), data_.threads, [&](std::size_t i) {
      laws_[i] = from_best_start(data_, subset, *none_.hypothesis, *list[i], scales);
    });
    for (std::size_t i = 0; i < laws_.size(); ++i) {
      report("fitting " + std::string(list[i]->card().name),
             0.2 + 0.4 * static_cast<double>(i) / static_cast<double>(laws_.size()));
      converge(laws_[i]);
    }
    if (!is_near_noise(laws_, data_.criteria)) {
      restart_best(data_, *none_.hypothesis, none_, laws_,
                   [](const FittedCandidate&) { return true; });
    }
  }

  // Laws that the recording does not determine follow those that it does; no friction at all comes
  // first where no law is a gain.
  void rank_laws() {
    const auto middle =
        std::stable_partition(laws_.begin(), laws_.end(),
                              [this](const FittedCandidate& each) { return is_determined(each); });
    std::vector<FittedCandidate> undetermined(std::make_move_iterator(middle),
                                              std::make_move_iterator(laws_.end()));
    laws_.erase(middle, laws_.end());
    for (std::vector<FittedCandidate>* part : {&laws_, &undetermined}) {
      if (!part->empty()) rank(*part, data_, none_.held_out, data_.seed);
    }
    laws_.insert(laws_.end(), std::make_move_iterator(undetermined.begin()),
                 std::make_move_iterator(undetermined.end()));
    const bool needed =
        is_gain(none_.held_out, laws_.front().held_out, data_.noise_is_known, data_.criteria, 0.0);
    laws_.insert(needed ? laws_.end() : laws_.begin(), none_);
    probability_ = probabilities(laws_, data_.criteria, data_.seed);
  }

  SearchData data_;
  const Options& options_;
  const Model& declared_;
  FittedCandidate none_;
  std::vector<FittedCandidate> laws_;
  std::vector<double> probability_;
};

FittedLaw described(const FittedCandidate& each) {
  FittedLaw out;
  const physics::Effect* law = each.candidate.effect;
  out.id = law == nullptr ? "none" : std::string(law->card().id);
  out.name = law == nullptr ? "no friction" : std::string(law->card().name);
  out.statement = law == nullptr ? "There is no friction." : statement_of(each);
  if (law != nullptr) out.parameters = estimates_of(each);
  out.model = posterior_model(each);
  physics::settle_law(out.model);
  return out;
}

std::string separating_run(const LawFits& fits, const FittedCandidate& other, double horizon_s) {
  const FittedCandidate& first = fits.laws().front();
  const SearchData& data = fits.data();
  const auto found = separation_of(data.experiments.front(), {&*first.hypothesis, first.fitted.z},
                                   {&*other.hypothesis, other.fitted.z}, horizon_s, data.seed,
                                   data.threads, data.criteria);
  if (found) return sentence_of(*found);
  const physics::Effect* law = other.candidate.effect;
  return law == nullptr ? "no variation of this run" : std::string(law->card().experiment);
}

std::string listed(const std::vector<std::string>& names) {
  std::string out;
  for (std::size_t i = 0; i < names.size(); ++i) {
    out += (i == 0 ? "" : (i + 1 == names.size() ? " and " : ", ")) + names[i];
  }
  return out;
}

std::string conclusion_of(const LawComparison& result) {
  const FittedLaw& first = result.laws.front();
  std::vector<std::string> apart;
  std::vector<std::string> alike;
  for (std::size_t i = 1; i < result.laws.size(); ++i) {
    (result.laws[i].distinguished ? apart : alike).push_back(result.laws[i].id);
  }
  std::string out = "Preferred: " + first.id + ". " + first.statement;
  if (!apart.empty()) {
    out += " This recording distinguishes it from " + listed(apart) + ", which predict worse.";
  }
  if (!alike.empty()) {
    out += " It does not distinguish it from " + listed(alike) +
           ": of laws that predict equally well the simplest comes first.";
  }
  return out;
}

}  // namespace

LawComparison compare_laws(const std::vector<protocol::Recording>& recordings,
                           const Model& declared, const Options& options) {
  if (const std::string words = invalid(options.criteria); !words.empty()) {
    throw std::invalid_argument("criteria: " + words);
  }
  Prepared prepared = prepare(recordings, declared, options);
  const Model model = with_instruments(declared, prepared.experiments.front());
  SearchData data =
      search_data(prepared.experiments, options.criteria, options.seed, options.threads);
  data.train.stop = data.held_out.stop = options.stop;
  LawFits fits(std::move(data), options, declared);
  fits.run(model);

  LawComparison out;
  out.horizon_s = prepared.horizon_s;
  out.windows = prepared.windows;
  out.integrity = std::move(prepared.integrity);
  out.noise_is_known = fits.data().noise_is_known;
  out.dimensionless = declared.dimensionless;
  const Experiment& first = prepared.experiments.front();
  const Task reported = windows_for(fits.data(), {Use::report});
  const std::vector<FittedCandidate>& laws = fits.laws();
  constexpr std::size_t drawn = 3;
  for (std::size_t i = 0; i < laws.size(); ++i) {
    if (options.progress) {
      options.progress("comparing",
                       0.8 + 0.2 * static_cast<double>(i) / static_cast<double>(laws.size()));
    }
    FittedLaw law = described(laws[i]);
    law.over_first = score_gain(laws.front().held_out, laws[i].held_out);
    law.probability = fits.probability(i);
    law.determined = fits.is_determined(laws[i]);
    law.distinguished = i > 0 && fits.is_distinguished(laws[i]);
    if (i > 0 && !law.distinguished) {
      law.separating_run = separating_run(fits, laws[i], out.horizon_s);
    }
    law.held_out = score(reported, *laws[i].hypothesis, laws[i].fitted.z);
    if (options.evidence && i < drawn) law.curves = law_curves(law.model, first);
    out.laws.push_back(std::move(law));
  }
  if (options.evidence) out.recorded = recorded_friction(first);
  out.conclusion = conclusion_of(out);
  if (options.progress) options.progress("done", 1.0);
  return out;
}

}  // namespace stickslip::diagnosis
