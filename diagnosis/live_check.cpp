// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/live_check.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <iterator>
#include <numeric>
#include <random>
#include <stdexcept>

#include "diagnosis/finalists.h"
#include "diagnosis/held_out.h"
#include "diagnosis/selection.h"
#include "diagnosis/significance.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "physics/result_units.h"

namespace stickslip::diagnosis {

namespace {

// Prediction horizon: long enough to show dynamics, short against the divergence of chaos.
constexpr double horizon_s = 0.25;
// A declared or estimated noise level is right to this share.
constexpr double declared_noise_uncertainty = 0.03;
constexpr double estimated_noise_uncertainty = 0.08;
constexpr std::size_t least_windows = 3;
// Checks in a row that show a deviation before it is reported.
constexpr int confirmations = 2;
// Further fits before a deviation is reported.
constexpr int other_starts = 8;
constexpr double certain_probability = 0.95;
constexpr double certain_deviate = 1.645;  // which noise stays below with that probability
constexpr double least_mentioned_probability = 0.05;
// Times after an explanation that is not certain until the next one [s], doubled each time.
constexpr double first_explanation_s = 0.5;
constexpr double last_explanation_s = 8.0;

double deviate_for(double days) {
  if (!(days > 0.0)) throw std::invalid_argument("days_between_false_alarms must be above 0");
  const double checks = days * 86400.0 / LiveCheck::every_s;
  return normal_deviate(std::min(0.1, 1.0 / checks));
}

// The largest mean square of residuals at this deviate of the normal distribution, for a noise
// level with a relative standard deviation of `uncertainty`.
double chi2_limit(double deviate, double samples, double uncertainty) {
  return 1.0 + deviate * std::sqrt(2.0 / samples + 4.0 * uncertainty * uncertainty);
}

std::string percent_text(double probability) {
  if (probability > 0.995) return "above 99 %";
  return physics::number_text(std::round(100.0 * probability), 2) + " %";
}

struct Misfit {
  double square = 0.0;  ///< sum of the squared scaled residuals
  double count = 0.0;
};

std::array<Misfit, predicted_channels> misfit_by_channel(const Task& task,
                                                         const Hypothesis& hypothesis,
                                                         const Fit& fit) {
  std::array<Misfit, predicted_channels> out{};
  for (std::size_t w = 0; w < fit.state.size(); ++w) {
    const Eigen::VectorXd residual = residuals_of(task, w, hypothesis, fit.z, fit.state[w]);
    const Window& window = task.window(w);
    Eigen::Index row = 0;
    for_each_compared(task.experiment(w), window.begin, window.end,
                      [&](std::size_t, std::size_t c) {
                        out[c].square += residual[row] * residual[row];
                        out[c].count += 1.0;
                        ++row;
                      });
  }
  return out;
}

FitOptions fit_of(int iterations) {
  FitOptions options;
  options.iterations = iterations;
  options.tolerance = 1.0e-3;
  options.covariance = false;
  options.start_anew = false;  // checks follow one another: the last states are near
  return options;
}

// Of the candidates that were fitted from several starts, the better fit.
void keep_best_of_each(std::vector<FittedCandidate>& candidates) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const FittedCandidate& a, const FittedCandidate& b) {
                     return a.fitted.cost < b.fitted.cost;
                   });
  std::vector<FittedCandidate> best;
  for (FittedCandidate& each : candidates) {
    const bool is_known = std::any_of(best.begin(), best.end(), [&](const FittedCandidate& better) {
      return better.candidate == each.candidate;
    });
    if (!is_known) best.push_back(std::move(each));
  }
  candidates = std::move(best);
}

}  // namespace

std::string_view name_of(LiveStatus status) {
  switch (status) {
    case LiveStatus::waiting:
      return "waiting";
    case LiveStatus::follows:
      return "follows";
    case LiveStatus::broken:
      return "broken";
  }
  return "";
}

struct LiveCheck::Seconds {
  protocol::Recording recording;
  std::vector<Experiment> experiments;
  SearchData data;
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = 0;

  Seconds(const physics::Model& model, std::span<const Frame> frames,
          const LiveCheckSettings& settings)
      : begin_ns(frames.front().time_ns), end_ns(frames.back().time_ns) {
    recording.source = "the latest frames";
    recording.frames.assign(frames.begin(), frames.end());
    for (const Frame& frame : frames) recording.channels |= frame.valid;
    experiments.push_back(prepared(model));
    data = search_data(experiments, settings.criteria, 1, settings.threads);
    data.train.stop = settings.stop;
    data.held_out = data.train;
  }
  Experiment prepared(const physics::Model& model) const {
    Experiment out = make_experiment(recording, model);
    cut_windows(out, model, horizon_s);
    for (Window& window : out.windows) window.use = Use::fit;
    return out;
  }
  /// Standard deviation of the noise level, relative.
  double noise_uncertainty() const {
    return data.noise_is_known ? declared_noise_uncertainty : estimated_noise_uncertainty;
  }
  std::int64_t time_ns(std::size_t sample) const {
    return begin_ns + std::llround(1.0e9 * experiments.front().elapsed_s(sample));
  }
};

LiveCheck::LiveCheck(const physics::Model& model, const LiveCheckSettings& settings)
    : model_(model),
      settings_(settings),
      declared_(model),
      deviate_(deviate_for(settings.days_between_false_alarms)),
      z_(declared_.unknowns().size(), 0.0) {}

LiveCheck::~LiveCheck() = default;

LiveCheck::Outcome LiveCheck::outcome_of(const Seconds& seconds, const Fit& fit) const {
  const auto limit_of = [&](double samples) {
    return chi2_limit(deviate_, samples, seconds.noise_uncertainty());
  };
  Outcome out;
  double samples = 0.0;
  out.first_bad = fit.chi2.size();
  for (std::size_t w = fit.chi2.size(); w-- > 0;) {
    const double count = std::max(1, fit.count[w] - fit.states_per_window);
    samples += count;
    if (fit.chi2[w] / count > limit_of(count)) out.first_bad = w;
  }
  out.chi2 = fit.chi2_per_sample();
  out.limit = limit_of(samples);
  out.follows = out.chi2 <= out.limit &&
                prior_penalty(declared_, fit.z) <= settings_.criteria.implausible_prior_penalty;
  if (out.first_bad == fit.chi2.size()) out.first_bad = 0;
  return out;
}

std::vector<WindowState> LiveCheck::remembered_states(const Seconds& seconds) const {
  std::vector<WindowState> states = initial_states(seconds.data.train, declared_);
  const std::int64_t half_ns = std::llround(0.5e9 * seconds.experiments.front().period_s);
  for (std::size_t w = 0; w < states.size(); ++w) {
    const std::int64_t time_ns = seconds.time_ns(seconds.data.train.window(w).warm);
    for (const auto& [known_ns, state] : states_) {
      if (std::abs(known_ns - time_ns) < half_ns) states[w] = state;
    }
  }
  return states;
}

void LiveCheck::remember(const Seconds& seconds, const Fit& fit) {
  z_ = fit.z;
  states_.clear();
  for (std::size_t w = 0; w < fit.state.size(); ++w) {
    states_.emplace_back(seconds.time_ns(seconds.data.train.window(w).warm), fit.state[w]);
  }
}

Fit LiveCheck::fitted_from_declared(const Task& task) const {
  return fit_in_stages(task, declared_, std::vector<double>(z_.size(), 0.0),
                       initial_states(task, declared_), fit_of(14));
}

// From the latest fit, and where that does not follow the frames, from the declared values.
Fit LiveCheck::fitted(const Seconds& seconds) const {
  const Task& task = seconds.data.train;
  if (!states_.empty()) {
    Fit warm = fit(task, declared_, z_, remembered_states(seconds), fit_of(6));
    if (outcome_of(seconds, warm).follows) return warm;
  }
  return fitted_from_declared(task);
}

// An alarm must not come from a local minimum. In windows that grow to their length errors do too,
// and chaos leads a fit astray less; draws from the prior are other starts.
std::optional<Fit> LiveCheck::other_fit_that_follows(const Seconds& seconds) const {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::vector<double> start = z_;
  for (int draw = 0; draw < other_starts; ++draw) {
    Fit grown = fitted_in_growing_windows(seconds.data.train, start);
    if (outcome_of(seconds, grown).follows) return grown;
    for (double& z : start) z = normal(random);
  }
  return std::nullopt;
}

Fit LiveCheck::fitted_in_growing_windows(const Task& task, std::vector<double> z) const {
  constexpr int stages = 8;
  Fit out;
  out.z = std::move(z);
  out.state = initial_states(task, declared_);
  for (int stage = 1; stage <= stages; ++stage) {
    Task beginning = task;
    beginning.share = static_cast<double>(stage) / stages;
    FitOptions options = fit_of(stage < stages ? 3 : 12);
    options.multistart = stage == stages;
    out = fit(beginning, declared_, out.z, out.state, options);
  }
  return out;
}

// Share of the samples' nats that counts: a mean square of n residuals whose noise level is
// uncertain is known as well as that of fewer residuals of known noise.
double LiveCheck::informative_share(const Seconds& seconds, const Fit& fit) const {
  const double samples = std::accumulate(fit.count.begin(), fit.count.end(), 0.0);
  const double uncertainty = seconds.noise_uncertainty();
  return 1.0 / (1.0 + 2.0 * samples * uncertainty * uncertainty);
}

// Where the search for candidates begins. The misfit of the parameters that the rig followed last
// counts as noise, since a fit to the noise itself is far from both the parameters and the true
// states. What was there before the check began is found beside parameters that are fitted at that
// noise; what has begun only now, and draws such a fit far away, beside those of before.
std::vector<Fit> LiveCheck::fits_at_misfit(Task& task) const {
  const Fit known = fit_states(task, declared_, z_, fit_of(12));
  const double misfit = std::max(1.0, known.chi2_per_sample());
  for (double& sigma : task.sigma) sigma *= std::sqrt(misfit);
  std::vector<Fit> out{fit(task, declared_, z_, known.state, fit_of(12))};
  const std::vector<double>& z = out.front().z;
  const bool is_near = std::equal(z.begin(), z.end(), z_.begin(), [this](double a, double b) {
    return std::abs(a - b) <= settings_.criteria.distant_calibration;
  });
  if (!is_near) {
    out.push_back(fit_states(task, declared_, z_, fit_of(12)));
  }
  return out;
}

// Effects fitted to the frames; from the second start, where there is one, only where none of those
// from the first follows the frames.
std::vector<FittedCandidate> LiveCheck::candidates_for(const Seconds& seconds) const {
  SearchData data = seconds.data;
  FittedCandidate base;
  base.hypothesis = declared_;
  std::vector<FittedCandidate> all;
  for (Fit& start : fits_at_misfit(data.train)) {
    base.fitted = std::move(start);
    const ResidualFeatures features = residual_features(data.train, declared_, base.fitted);
    auto found = finalists(data, features, base, [](const std::string&, double) {});
    fit_thoroughly(seconds.data, found);
    std::move(found.begin(), found.end(), std::back_inserter(all));
    const auto follows = [this](const FittedCandidate& each) {
      return each.fitted.chi2_per_sample() <= verdict_.limit;
    };
    if (std::any_of(all.begin(), all.end(), follows)) break;
  }
  keep_best_of_each(all);
  return all;
}

std::vector<Explanation> LiveCheck::explanations_of(const Seconds& seconds, const Fit& fit) const {
  const SearchData& data = seconds.data;
  std::vector<FittedCandidate> candidates = candidates_for(seconds);
  if (candidates.empty()) return {};
  const double share = informative_share(seconds, fit);
  const auto score = [&](const Hypothesis& hypothesis, const Fit& fitted) {
    HeldOut out = score_of(fitted, data.train, hypothesis, fitted.z, data.noise_is_known);
    for (double& loss : out.loss) loss *= share;
    return out;
  };
  const HeldOut declared = score(declared_, fit);
  for (FittedCandidate& each : candidates) {
    each.held_out = score(*each.hypothesis, each.fitted);
    each.gain_z = gain_z(declared, each.held_out);
  }
  rank_determined(candidates, data, declared, data.seed);
  const std::vector<double> probability = probabilities(candidates, data.criteria, data.seed);
  const physics::ResultUnits units(model_);
  std::vector<Explanation> out;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const FittedCandidate& each = candidates[i];
    out.push_back({.relation = each.candidate.relation(),
                   .channel = each.candidate.place.channel,
                   .name = each.candidate.name(),
                   .statement = units.sentence(statement_of(each)),
                   .chi2 = each.held_out.chi2,
                   .probability = probability[i],
                   .agrees = agrees_with_channels(seconds, each)});
  }
  return out;
}

// Many channels that agree hide one that does not. Where the normal load is measured and an input
// of the model, another load is contradicted by its channel.
bool LiveCheck::agrees_with_channels(const Seconds& seconds, const FittedCandidate& each) const {
  const bool other_load = each.candidate.relation() == physics::Relation::normal_load;
  const bool load_is_input =
      model_.normal_load && model_.normal_load->law == physics::NormalLoadLaw::measured;
  if (other_load && load_is_input) return false;
  for (const auto& [square, count] :
       misfit_by_channel(seconds.data.train, *each.hypothesis, each.fitted)) {
    if (count == 0.0) continue;
    if (square / count > chi2_limit(deviate_, count, seconds.noise_uncertainty())) return false;
  }
  return true;
}

bool LiveCheck::set_status(LiveStatus status) {
  const bool changed = verdict_.status != status;
  verdict_.status = status;
  if (status != LiveStatus::broken) {
    misfits_ = 0;
    unexplained_.reset();
    verdict_.explanations.clear();
    verdict_.is_certain = verdict_.is_final = false;
  }
  return changed;
}

void LiveCheck::raise_alarm(const Seconds& seconds, const Outcome& outcome) {
  verdict_.since_ns = seconds.time_ns(seconds.data.train.window(outcome.first_bad).begin);
  verdict_.reported_ns = seconds.end_ns;
  ++verdict_.alarms;
  explain_at_ns_ = seconds.end_ns;
  explain_again_s_ = first_explanation_s;
}

bool LiveCheck::update(std::span<const Frame> frames) {
  std::unique_ptr<Seconds> seconds;
  try {
    seconds = std::make_unique<Seconds>(model_, frames, settings_);
  } catch (const InputError&) {
    return set_status(LiveStatus::waiting);
  }
  if (seconds->data.train.windows.size() < least_windows) return set_status(LiveStatus::waiting);
  Fit fit = fitted(*seconds);
  Outcome outcome = outcome_of(*seconds, fit);
  if (!outcome.follows && misfits_ + 1 == confirmations) {
    if (auto other = other_fit_that_follows(*seconds)) {
      fit = std::move(*other);
      outcome = outcome_of(*seconds, fit);
    }
  }
  verdict_.chi2 = outcome.chi2;
  verdict_.limit = outcome.limit;
  if (outcome.follows) {
    remember(*seconds, fit);
    return set_status(LiveStatus::follows);
  }
  if (++misfits_ < confirmations) return false;
  if (verdict_.status != LiveStatus::broken) raise_alarm(*seconds, outcome);
  unexplained_ = std::move(seconds);
  unexplained_fit_ = fit;
  return set_status(LiveStatus::broken);
}

bool LiveCheck::is_suspicious() const {
  return misfits_ > 0 && verdict_.status != LiveStatus::broken;
}

bool LiveCheck::wants_explanation() const {
  return unexplained_ && !verdict_.is_final && unexplained_->end_ns >= explain_at_ns_;
}

void LiveCheck::explain() {
  if (!unexplained_) return;
  verdict_.explanations = explanations_of(*unexplained_, unexplained_fit_);
  double others = 0.0;
  std::erase_if(verdict_.explanations, [&others](const Explanation& each) {
    if (!each.agrees) others += each.probability;
    return !each.agrees;
  });
  for (const Explanation& each : verdict_.explanations) {
    const Explanation& first = verdict_.explanations.front();
    if (each.relation != first.relation || each.channel != first.channel) {
      others += each.probability;
    }
  }
  const std::vector<int>& count = unexplained_fit_.count;
  const double noise = chi2_limit(certain_deviate, std::accumulate(count.begin(), count.end(), 0.0),
                                  unexplained_->noise_uncertainty());
  verdict_.is_certain = !verdict_.explanations.empty() && others < 1.0 - certain_probability &&
                        verdict_.explanations.front().chi2 <= noise;
  verdict_.is_final = verdict_.is_certain || explain_again_s_ > last_explanation_s;
  explain_at_ns_ = unexplained_->end_ns + std::llround(1.0e9 * explain_again_s_);
  explain_again_s_ *= 2.0;
}

std::span<const Frame> latest_span(std::span<const Frame> frames) {
  if (frames.empty()) return {};
  constexpr auto every_ns = static_cast<std::int64_t>(1.0e9 * LiveCheck::every_s);
  constexpr auto span_ns = static_cast<std::int64_t>(1.0e9 * LiveCheck::span_s);
  constexpr auto least_ns = static_cast<std::int64_t>(1.0e9 * LiveCheck::least_s);
  const std::int64_t end_ns = frames.back().time_ns;
  const std::int64_t period_ns =
      frames.size() > 1 ? end_ns - frames[frames.size() - 2].time_ns : std::int64_t{0};
  const std::int64_t earliest_ns = std::max(frames.front().time_ns, end_ns - span_ns);
  const std::int64_t begin_ns = (earliest_ns + every_ns - 1) / every_ns * every_ns;
  if (end_ns + period_ns - begin_ns < least_ns) return {};
  const auto begin = std::lower_bound(
      frames.begin(), frames.end(), begin_ns,
      [](const Frame& frame, std::int64_t time_ns) { return frame.time_ns < time_ns; });
  return {begin, frames.end()};
}

std::string words_for(const LiveVerdict& verdict) {
  if (verdict.status == LiveStatus::waiting) return "too little motion to check the model";
  if (verdict.status == LiveStatus::follows) return "the rig follows its model";
  if (verdict.chi2 <= verdict.limit) {
    return "the rig does not follow its model: it needs parameters far beyond their declared "
           "uncertainties";
  }
  return "the rig does not follow its model: residuals have " +
         physics::number_text(verdict.chi2, 3) + " times the power of the noise";
}

std::string cause_in_words(const LiveVerdict& verdict) {
  const auto& all = verdict.explanations;
  if (all.empty() || all.front().chi2 > verdict.limit) {
    return "no single effect of the catalogue explains the model mismatch: diagnose the recording";
  }
  const auto described = [](const Explanation& each) {
    std::string out = each.statement;
    if (out.ends_with('.')) out.pop_back();
    out.append(" (").append(physics::name_of(each.relation));
    if (each.channel) out.append(" of ").append(info(*each.channel).stem);
    out.append(", ").append(percent_text(each.probability)).append(")");
    return out;
  };
  if (verdict.is_certain) return "probable cause of the model mismatch: " + described(all.front());
  std::string out = "the cause of the model mismatch is not certain yet: " + described(all.front());
  for (std::size_t i = 1; i < all.size(); ++i) {
    if (all[i].probability < least_mentioned_probability) continue;
    std::string other = described(all[i]);
    other.front() = static_cast<char>(std::tolower(static_cast<unsigned char>(other.front())));
    out += ", or " + other;
  }
  return out;
}

}  // namespace stickslip::diagnosis
