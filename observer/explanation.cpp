#include "observer/explanation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <string_view>
#include <utility>

#include "observer/kalman_filter.h"
#include "physics/catalogue.h"
#include "physics/number_text.h"

namespace stickslip::observer {

namespace {

using physics::Effect;
using physics::Model;
using physics::number_text;
using physics::Onset;
using physics::Parameter;
using physics::Place;
using physics::Relation;

constexpr double skip_after_break_s = 0.15;  // the break is dated to about 0.2 s
constexpr double longest_delay_s = 0.012;
constexpr double enough_s = 4.0;
constexpr double settle_s = 0.5;
constexpr double max_explained_s = 6.0;
// Innovations of a wrong model are correlated: this much time counts as one observation.
constexpr double correlation_s = 0.02;
// Degrees of freedom of the Student distribution of innovations: no model is exact.
constexpr double degrees_of_freedom = 4.0;
constexpr double largest_squared_innovation = 64.0;
constexpr double parameter_penalty = 1.0;
constexpr double divergence_penalty = 20.0;  // per frame
constexpr double negligible_sigma = 1.0e-6;  // relative
constexpr int refinements = 5;
constexpr std::size_t refined = 4;  // candidates

/// A change that may have happened.
struct Candidate {
  Relation relation = Relation::friction_law;
  Channel channel = Channel::displacement;  ///< Relation::sensor only
  std::vector<double> sizes;                ///< first guesses, most likely first
  double least = 0.0;                       ///< see physics::Onset::least
  bool is_delay = false;                    ///< the size is a delay of the channel [s]
  std::function<void(Model&, double)> apply = {};
  std::function<std::string(double)> statement = {};
};

/// A declared parameter that can change while a rig runs. Sizes of its changes are factors.
struct ChangingParameter {
  Relation relation;
  std::string_view name;
  std::string_view unit;
  std::vector<double> sizes;
  double least;
  Parameter* (*parameter)(Model&);  ///< nullptr where the model does not have it
};

const std::vector<ChangingParameter>& friction_parameters() {
  static const std::vector<ChangingParameter> list = {
      {Relation::friction_law,
       "mu",
       "",
       {0.85, 1.2, 0.7, 1.4},
       0.04,
       [](Model& m) {
         return m.friction.law != physics::FrictionLaw::none ? &m.friction.mu : nullptr;
       }},
      {Relation::friction_law, "the rate gamma", " /s", {0.6, 1.6, 0.3, 3.0}, 0.3, [](Model& m) {
         return m.friction.law == physics::FrictionLaw::state_variable ? &m.friction.rate_per_s
                                                                       : nullptr;
       }}};
  return list;
}

const std::vector<ChangingParameter>& structure_parameters() {
  static const std::vector<ChangingParameter> list = {
      {Relation::force_balance,
       "the mass's natural frequency",
       " Hz",
       {0.95, 1.05, 0.9, 1.1, 0.85, 1.15},
       0.02,
       [](Model& m) {
         auto& frequency = m.oscillator.natural_frequency_hz;
         return frequency ? &*frequency : nullptr;
       }},
      {Relation::load_cell,
       "the load cell's natural frequency",
       " Hz",
       {0.9, 0.8, 0.7, 0.6, 0.5, 1.15},
       0.04,
       [](Model& m) {
         const bool resonates =
             m.load_cell && m.load_cell->dynamics == physics::LoadCellDynamics::resonant;
         return resonates ? &m.load_cell->natural_frequency_hz : nullptr;
       }},
      {Relation::normal_load,
       "the normal load at rest",
       " N",
       {0.85, 1.15, 0.7, 1.3},
       0.04,
       [](Model& m) {
         const bool declared =
             m.normal_load && m.normal_load->law != physics::NormalLoadLaw::measured;
         return declared ? &m.normal_load->load_n : nullptr;
       }}};
  return list;
}

void add_parameters(const std::vector<ChangingParameter>& list, Model model,
                    std::vector<Candidate>& out) {
  for (const ChangingParameter& each : list) {
    const Parameter* const parameter = each.parameter(model);
    if (parameter == nullptr) continue;
    Candidate candidate{.relation = each.relation, .sizes = each.sizes, .least = each.least};
    candidate.apply = [get = each.parameter](Model& m, double size) { get(m)->value *= size; };
    candidate.statement = [&each, before = parameter->value](double size) {
      return std::string(each.name) + " is " + number_text(size * before) + std::string(each.unit) +
             " instead of " + number_text(before) + std::string(each.unit);
    };
    out.push_back(std::move(candidate));
  }
}

Candidate onset_of(const Effect& effect, const Onset& onset, const Place& place) {
  Candidate candidate{.relation = effect.card().relation,
                      .channel = place.channel.value_or(Channel::displacement),
                      .sizes = onset.sizes,
                      .least = onset.least,
                      .is_delay = onset.is_delay};
  if (!onset.is_delay) {
    candidate.apply = [apply = onset.apply, place](Model& m, double size) {
      apply(m, place, size);
    };
  }
  candidate.statement = [statement = onset.statement, place](double size) {
    return statement(place, size);
  };
  return candidate;
}

/// Onsets of effects that act on the rig itself.
void add_onsets(const Model& model, std::vector<Candidate>& out) {
  for (const Effect* effect : physics::catalogue()) {
    const Relation relation = effect->card().relation;
    if (relation == Relation::sensor) continue;
    const auto onset = effect->onset();
    if (!onset || !physics::can_be_missing(*effect, model)) continue;
    // The friction of a term is not that of the filter's own states.
    const bool no_friction = model.friction.law == physics::FrictionLaw::none;
    if (relation == Relation::friction_law && no_friction) continue;
    out.push_back(onset_of(*effect, *onset, {}));
  }
}

/// Onsets of errors of one sensor; an error that the model has already can change.
void add_sensor_onsets(Channel channel, std::vector<Candidate>& out) {
  const Place place{channel, std::nullopt};
  for (const Effect* effect : physics::catalogue()) {
    if (effect->card().relation != Relation::sensor || !effect->acts_on(place)) continue;
    if (const auto onset = effect->onset()) out.push_back(onset_of(*effect, *onset, place));
  }
}

std::vector<Candidate> candidates_of(const Model& model) {
  std::vector<Candidate> out;
  add_parameters(friction_parameters(), model, out);
  add_onsets(model, out);
  add_parameters(structure_parameters(), model, out);
  add_sensor_onsets(Channel::displacement, out);
  add_sensor_onsets(Channel::velocity, out);
  if (model.friction.law != physics::FrictionLaw::none) {
    add_sensor_onsets(Channel::friction_force, out);
  }
  return out;
}

/// The frames with that channel advanced by a number of periods, interpolated linearly.
std::vector<Frame> advanced(std::span<const Frame> frames, Channel channel, double periods) {
  std::vector<Frame> out(frames.begin(), frames.end());
  const auto whole = static_cast<std::size_t>(periods);
  const double part = periods - static_cast<double>(whole);
  for (std::size_t k = 0; k < out.size(); ++k) {
    const std::size_t next = k + whole + 1;
    if (!out[k].has(channel)) continue;
    if (next >= frames.size() || !frames[next - 1].has(channel) || !frames[next].has(channel)) {
      out[k].invalidate(channel);
      continue;
    }
    out[k].set(channel, (1.0 - part) * frames[next - 1][channel] + part * frames[next][channel]);
  }
  return out;
}

double log_density(double squared, double variance) {
  return -0.5 * (degrees_of_freedom + 1.0) * std::log1p(squared / degrees_of_freedom) -
         0.5 * std::log(variance);
}

/// Of the readings of one frame, including those that the filter rejected.
double log_likelihood(const FrictionEstimate& e) {
  double sum = 0.0;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if ((e.innovation_valid >> i & 1U) == 0 || !(e.innovation_std[i] > 0.0)) continue;
    const double variance = e.innovation_std[i] * e.innovation_std[i];
    const double squared =
        std::min(largest_squared_innovation, e.innovation[i] * e.innovation[i] / variance);
    sum += log_density(squared, variance);
  }
  return sum;
}

/// The frames after the break, filtered again under changed models.
class Replay {
 public:
  Replay(const Model& model, double period_s, std::span<const Frame> frames)
      : model_(model), period_s_(period_s), frames_(frames) {}

  /// Log likelihood of the readings under the model as it was; empty where it is unsupported.
  std::optional<double> score() const { return filtered(model_, frames_); }

  /// The same after a change of that size.
  std::optional<double> score(const Candidate& candidate, double size) const {
    if (candidate.is_delay) {
      if (size == 0.0) return score();
      return filtered(model_, advanced(frames_, candidate.channel, size / period_s_));
    }
    Model changed = model_;
    candidate.apply(changed, size);
    return filtered(changed, frames_);
  }

 private:
  std::optional<double> filtered(const Model& model, std::span<const Frame> frames) const {
    KalmanFilter filter(model, period_s_, FrictionPrior::fixed);
    if (!filter.unsupported().empty()) return std::nullopt;
    // An advanced channel lacks its last frames, which therefore count for no candidate.
    const auto settle = static_cast<std::size_t>(settle_s / period_s_);
    const auto tail = static_cast<std::size_t>(longest_delay_s / period_s_) + 2;
    double sum = 0.0;
    double latest = 0.0;
    for (std::size_t k = 0; k + tail < frames.size(); ++k) {
      filter.update(frames[k]);
      const FrictionEstimate& e = filter.estimate();
      if (k < settle) continue;
      // A filter that recovers from divergence explains nothing.
      const bool diverged = !e.valid;
      if (!diverged) latest = log_likelihood(e);
      sum += diverged ? latest - divergence_penalty : latest;
    }
    return sum;
  }

  const Model& model_;
  double period_s_;
  std::span<const Frame> frames_;
};

/// A candidate and its best size so far.
struct Trial {
  const Candidate* candidate;
  double size = 0.0;
  double score = 0.0;
  bool scored = false;
};

void attempt(const Replay& replay, double size, Trial& trial) {
  const Candidate& candidate = *trial.candidate;
  if (std::min(std::abs(size), std::abs(std::log(size))) < candidate.least) return;
  const auto score = replay.score(candidate, size);
  if (!score || (trial.scored && *score <= trial.score)) return;
  trial.size = size;
  trial.score = *score;
  trial.scored = true;
}

void refine(const Replay& replay, Trial& trial) {
  const std::vector<double>& sizes = trial.candidate->sizes;
  const auto [least, most] = std::minmax_element(sizes.begin(), sizes.end());
  double step = std::log(*most / *least) / static_cast<double>(sizes.size() - 1);
  for (int k = 0; k < refinements; ++k) {
    step *= 0.5;
    const double centre = trial.size;
    attempt(replay, centre * std::exp(step), trial);
    attempt(replay, centre * std::exp(-step), trial);
  }
}

std::vector<Trial> trials_of(const std::vector<Candidate>& candidates, const Replay& replay) {
  std::vector<Trial> trials;
  for (const Candidate& candidate : candidates) {
    Trial trial{&candidate};
    for (const double size : candidate.sizes) attempt(replay, size, trial);
    if (trial.scored) trials.push_back(trial);
  }
  const auto better = [](const Trial& a, const Trial& b) { return a.score > b.score; };
  std::sort(trials.begin(), trials.end(), better);
  for (std::size_t i = 0; i < std::min(refined, trials.size()); ++i) refine(replay, trials[i]);
  std::sort(trials.begin(), trials.end(), better);
  return trials;
}

/// The model with the observer's estimates from before the break.
Model before_break(Model model, const ModelVerdict& verdict) {
  if (verdict.reference_mu > 0.0) model.friction.mu.value = verdict.reference_mu;
  if (verdict.reference_gamma_per_s > 0.0)
    model.friction.rate_per_s.value = verdict.reference_gamma_per_s;
  if (verdict.reference_load_n > 0.0 && model.normal_load) {
    model.normal_load->load_n.value = verdict.reference_load_n;
  }
  // A load without uncertainty would not be compared with its channel.
  if (model.normal_load && model.normal_load->load_n.sigma == 0.0) {
    model.normal_load->load_n.sigma = negligible_sigma * model.normal_load->load_n.value;
  }
  return model;
}

std::int64_t nanoseconds(double s) { return std::llround(1.0e9 * s); }

std::span<const Frame> after_break(std::span<const Frame> frames, const ModelVerdict& verdict) {
  const std::int64_t to_ns = explained_until_ns(verdict);
  const std::int64_t from_ns = std::max(verdict.since_ns + nanoseconds(skip_after_break_s),
                                        to_ns - nanoseconds(max_explained_s));
  const auto earlier = [](const Frame& frame, std::int64_t time_ns) {
    return frame.time_ns < time_ns;
  };
  const auto begin = std::lower_bound(frames.begin(), frames.end(), from_ns, earlier);
  const auto end = std::lower_bound(begin, frames.end(), to_ns, earlier);
  return frames.subspan(static_cast<std::size_t>(begin - frames.begin()),
                        static_cast<std::size_t>(end - begin));
}

}  // namespace

std::int64_t explained_until_ns(const ModelVerdict& verdict) {
  return std::max(verdict.reported_ns, verdict.since_ns + nanoseconds(enough_s));
}

std::vector<Explanation> explanations_of(const Model& believed, double period_s,
                                         std::span<const Frame> frames,
                                         const ModelVerdict& verdict) {
  const std::span<const Frame> after = after_break(frames, verdict);
  if (after.empty() || static_cast<double>(after.back().time_ns - after.front().time_ns) * 1.0e-9 <
                           min_explained_s - skip_after_break_s) {
    return {};
  }
  const Model before = before_break(believed, verdict);
  const Replay replay(before, period_s, after);
  const std::optional<double> unchanged = replay.score();
  if (!unchanged) return {};
  const std::vector<Candidate> candidates = candidates_of(before);
  const std::vector<Trial> trials = trials_of(candidates, replay);
  const double observations = 1.0 / std::max(1.0, correlation_s / period_s);
  std::vector<Explanation> out;
  double sum = 0.0;
  for (const Trial& trial : trials) {
    Explanation e;
    e.relation = trial.candidate->relation;
    e.channel = trial.candidate->channel;
    e.size = trial.size;
    e.words = trial.candidate->statement(trial.size);
    e.log_likelihood = observations * (trial.score - *unchanged) - parameter_penalty;
    e.probability = std::exp(observations * (trial.score - trials.front().score));
    sum += e.probability;
    out.push_back(std::move(e));
  }
  for (Explanation& e : out) e.probability /= sum;
  return out;
}

}  // namespace stickslip::observer
