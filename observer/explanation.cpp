#include "observer/explanation.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string_view>
#include <utility>

#include "observer/kalman_filter.h"
#include "physics/number_text.h"

namespace stickslip::observer {

namespace {

using physics::Model;
using physics::number_text;
using physics::Relation;

// The change is dated to about 0.2 s.
constexpr double skip_after_break_s = 0.15;
constexpr double longest_delay_s = 0.012;
constexpr double enough_s = 4.0;
constexpr double settle_s = 0.5;
constexpr double most_explained_s = 6.0;
// A wrong model leaves innovations that hang together: so many seconds of them are one observation.
constexpr double news_s = 0.02;
// Degrees of freedom of the law of an innovation: no model is right to the last reading.
constexpr double freedom = 4.0;
constexpr double worst_innovation = 64.0;
constexpr double price_of_a_parameter = 1.0;
constexpr double price_of_being_lost = 20.0;  // a frame
constexpr double certain = 1.0e-6;
constexpr int refinements = 5;
constexpr std::size_t refined = 4;  // suspects

/// What a suspect makes of model and readings at one size.
struct Setting {
  Model model;
  double delay_s = 0.0;  ///< of the channel
};

/// Something that may have changed, with the sizes to begin with, most usual first.
struct Suspect {
  Relation relation;
  Channel channel = Channel::displacement;
  std::vector<double> sizes;
  double least;  ///< of a change worth an alarm: the size itself for a delay, else its logarithm
  std::function<Setting(const Model&, double)> setting;
  std::function<std::string(double)> words;
};

/// A number of the model that has become another one; sizes are factors.
Suspect moved(Relation relation, std::vector<double> sizes, double least, std::string_view what,
              std::string_view unit, physics::Parameter& (*number)(Model&), Model model) {
  const double was = number(model).value;
  return {relation,
          {},
          std::move(sizes),
          least,
          [number](const Model& m, double size) {
            Setting out{m};
            number(out.model).value *= size;
            return out;
          },
          [what = std::string(what), unit = std::string(unit), was](double size) {
            return what + " is " + number_text(size * was) + unit + " instead of " +
                   number_text(was) + unit;
          }};
}

Model with_bristle(Model model, double stiffness_n_m) {
  model.terms.push_back({"contact_compliance",
                         std::nullopt,
                         {{"contact_stiffness_n_m", {stiffness_n_m}},
                          {"contact_damping_n_s_m", {0.02 * std::sqrt(stiffness_n_m)}}}});
  return model;
}

void add_friction(const Model& model, std::vector<Suspect>& out) {
  if (model.friction.law == physics::FrictionLaw::none) return;
  out.push_back(moved(
      Relation::friction_law, {0.85, 1.2, 0.7, 1.4}, 0.04, "mu", "",
      [](Model& m) -> physics::Parameter& { return m.friction.mu; }, model));
  if (model.friction.law == physics::FrictionLaw::state_variable) {
    out.push_back(moved(
        Relation::friction_law, {0.6, 1.6, 0.3, 3.0}, 0.3, "the rate gamma", " /s",
        [](Model& m) -> physics::Parameter& { return m.friction.rate_per_s; }, model));
  }
  const bool yields = std::any_of(model.terms.begin(), model.terms.end(),
                                  [](const auto& term) { return term.id == "contact_compliance"; });
  if (yields) return;
  out.push_back(
      {Relation::friction_law,
       {},
       {30.0, 60.0, 120.0, 240.0, 500.0},
       0.0,
       [](const Model& m, double size) { return Setting{with_bristle(m, size)}; },
       [](double size) { return "the contact yields, with " + number_text(size) + " N/m"; }});
}

/// The channel reads so many times what it did.
Model with_gain(Model model, Channel channel, double factor) {
  for (physics::Term& term : model.terms) {
    if (term.id != "gain_error" || term.channel != channel) continue;
    term.parameters["gain"].value *= factor;
    return model;
  }
  model.terms.push_back({"gain_error", channel, {{"gain", {factor}}}});
  return model;
}

void add_structure(const Model& model, std::vector<Suspect>& out) {
  if (model.oscillator.natural_frequency_hz) {
    out.push_back(moved(
        Relation::force_balance, {0.95, 1.05, 0.9, 1.1, 0.85, 1.15}, 0.02,
        "the mass's natural frequency", " Hz",
        [](Model& m) -> physics::Parameter& { return *m.oscillator.natural_frequency_hz; }, model));
  }
  if (model.load_cell && model.load_cell->dynamics == physics::LoadCellDynamics::resonant) {
    out.push_back(moved(
        Relation::load_cell, {0.9, 0.8, 0.7, 0.6, 0.5, 1.15}, 0.04,
        "the load cell's natural frequency", " Hz",
        [](Model& m) -> physics::Parameter& { return m.load_cell->natural_frequency_hz; }, model));
  }
  if (model.normal_load && model.normal_load->law != physics::NormalLoadLaw::measured) {
    out.push_back(moved(
        Relation::normal_load, {0.85, 1.15, 0.7, 1.3}, 0.04, "the normal load at rest", " N",
        [](Model& m) -> physics::Parameter& { return m.normal_load->load_n; }, model));
  }
}

void add_sensor(Channel channel, std::vector<Suspect>& out) {
  const std::string name(info(channel).stem);
  out.push_back({Relation::sensor,
                 channel,
                 {0.002, 0.004, 0.006, 0.009},
                 0.001,
                 [](const Model& m, double size) { return Setting{.model = m, .delay_s = size}; },
                 [name](double size) {
                   return "the channel " + name + " is late by " + number_text(1.0e3 * size) +
                          " ms";
                 }});
  out.push_back({Relation::sensor,
                 channel,
                 {0.9, 1.1, 0.75, 1.3},
                 0.02,
                 [channel](const Model& m, double size) {
                   return Setting{.model = with_gain(m, channel, size)};
                 },
                 [name](double size) {
                   return "the channel " + name + " reads " + number_text(size) +
                          " times what it did";
                 }});
}

std::vector<Suspect> suspects_of(const Model& model) {
  std::vector<Suspect> out;
  add_friction(model, out);
  add_structure(model, out);
  add_sensor(Channel::displacement, out);
  add_sensor(Channel::velocity, out);
  if (model.friction.law != physics::FrictionLaw::none) add_sensor(Channel::friction_force, out);
  return out;
}

/// The frames as they would have been if the channel had no lag.
std::vector<Frame> put_in_time(std::span<const Frame> frames, Channel channel, double periods) {
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
  return -0.5 * (freedom + 1.0) * std::log1p(squared / freedom) - 0.5 * std::log(variance);
}

/// Of one frame's readings, whether the filter used or refused them.
double log_likelihood(const FrictionEstimate& e) {
  double sum = 0.0;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if ((e.innovation_valid >> i & 1U) == 0 || !(e.innovation_std[i] > 0.0)) continue;
    const double variance = e.innovation_std[i] * e.innovation_std[i];
    sum += log_density(std::min(worst_innovation, e.innovation[i] * e.innovation[i] / variance),
                       variance);
  }
  return sum;
}

class Replay {
 public:
  Replay(const Model& believed, double period_s, std::span<const Frame> frames)
      : model_(believed), period_s_(period_s), frames_(frames) {}

  const Model& model() const { return model_; }

  /// Of the readings under this setting; nothing where the observer does not follow its model.
  std::optional<double> score(const Setting& setting, Channel channel) const {
    if (setting.delay_s == 0.0) return follow(setting.model, frames_);
    return follow(setting.model, put_in_time(frames_, channel, setting.delay_s / period_s_));
  }

 private:
  std::optional<double> follow(const Model& model, std::span<const Frame> frames) const {
    KalmanFilter filter(model, period_s_, Contact::known);
    if (!filter.unsupported().empty()) return std::nullopt;
    // What would be lost by delay is lost by all: the last frames are not counted.
    const auto settle = static_cast<std::size_t>(settle_s / period_s_);
    const auto tail = static_cast<std::size_t>(longest_delay_s / period_s_) + 2;
    double sum = 0.0;
    double latest = 0.0;
    for (std::size_t k = 0; k + tail < frames.size(); ++k) {
      filter.update(frames[k]);
      const FrictionEstimate& e = filter.estimate();
      if (k < settle) continue;
      // While a filter that was lost finds its way it explains nothing.
      const bool lost = !e.valid;
      if (!lost) latest = log_likelihood(e);
      sum += lost ? latest - price_of_being_lost : latest;
    }
    return sum;
  }

  const Model& model_;
  double period_s_;
  std::span<const Frame> frames_;
};

/// A suspect and the size that explains most so far.
struct Trial {
  const Suspect* suspect;
  double size = 0.0;
  double score = 0.0;
  bool scored = false;
};

void attempt(const Replay& replay, double size, Trial& trial) {
  const Suspect& suspect = *trial.suspect;
  if (std::min(std::abs(size), std::abs(std::log(size))) < suspect.least) return;
  const auto score = replay.score(suspect.setting(replay.model(), size), suspect.channel);
  if (!score || (trial.scored && *score <= trial.score)) return;
  trial.size = size;
  trial.score = *score;
  trial.scored = true;
}

void refine(const Replay& replay, Trial& trial) {
  const auto [least, most] =
      std::minmax_element(trial.suspect->sizes.begin(), trial.suspect->sizes.end());
  double step = std::log(*most / *least) / static_cast<double>(trial.suspect->sizes.size() - 1);
  for (int k = 0; k < refinements; ++k) {
    step *= 0.5;
    const double centre = trial.size;
    attempt(replay, centre * std::exp(step), trial);
    attempt(replay, centre * std::exp(-step), trial);
  }
}

std::vector<Trial> trials_of(const std::vector<Suspect>& suspects, const Replay& replay) {
  std::vector<Trial> trials;
  for (const Suspect& suspect : suspects) {
    Trial trial{&suspect};
    for (const double size : suspect.sizes) attempt(replay, size, trial);
    if (trial.scored) trials.push_back(trial);
  }
  const auto better = [](const Trial& a, const Trial& b) { return a.score > b.score; };
  std::sort(trials.begin(), trials.end(), better);
  for (std::size_t i = 0; i < std::min(refined, trials.size()); ++i) refine(replay, trials[i]);
  std::sort(trials.begin(), trials.end(), better);
  return trials;
}

Model as_it_was(Model model, const ModelVerdict& verdict) {
  if (verdict.usual_mu > 0.0) model.friction.mu.value = verdict.usual_mu;
  if (verdict.usual_gamma_per_s > 0.0) model.friction.rate_per_s.value = verdict.usual_gamma_per_s;
  if (verdict.usual_load_n > 0.0 && model.normal_load) {
    model.normal_load->load_n.value = verdict.usual_load_n;
  }
  // A load that is held to be certain would not be compared with its channel.
  if (model.normal_load && model.normal_load->load_n.sigma == 0.0) {
    model.normal_load->load_n.sigma = certain * model.normal_load->load_n.value;
  }
  return model;
}

std::int64_t nanoseconds(double s) { return std::llround(1.0e9 * s); }

std::span<const Frame> after_break(std::span<const Frame> frames, const ModelVerdict& verdict) {
  const std::int64_t to_ns = explained_until_ns(verdict);
  const std::int64_t from_ns = std::max(verdict.since_ns + nanoseconds(skip_after_break_s),
                                        to_ns - nanoseconds(most_explained_s));
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
  const std::span<const Frame> seen = after_break(frames, verdict);
  if (seen.empty() || static_cast<double>(seen.back().time_ns - seen.front().time_ns) * 1.0e-9 <
                          least_explained_s - skip_after_break_s) {
    return {};
  }
  const Model before = as_it_was(believed, verdict);
  const Replay replay(before, period_s, seen);
  const std::optional<double> unchanged = replay.score(Setting{before}, {});
  if (!unchanged) return {};
  const std::vector<Suspect> suspects = suspects_of(before);
  const std::vector<Trial> trials = trials_of(suspects, replay);
  const double observations = 1.0 / std::max(1.0, news_s / period_s);
  std::vector<Explanation> out;
  double sum = 0.0;
  for (const Trial& trial : trials) {
    Explanation e;
    e.relation = trial.suspect->relation;
    e.channel = trial.suspect->channel;
    e.size = trial.size;
    e.words = trial.suspect->words(trial.size);
    e.log_likelihood = observations * (trial.score - *unchanged) - price_of_a_parameter;
    e.probability = std::exp(observations * (trial.score - trials.front().score));
    sum += e.probability;
    out.push_back(std::move(e));
  }
  for (Explanation& e : out) e.probability /= sum;
  return out;
}

}  // namespace stickslip::observer
