#include "diagnosis/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <span>
#include <tuple>

#include "diagnosis/locate.h"
#include "diagnosis/median.h"
#include "diagnosis/parallel/for_each.h"
#include "diagnosis/separation.h"
#include "diagnosis/suspects.h"
#include "physics/effects/catalogue.h"
#include "physics/problem.h"

namespace stickslip::diagnosis {

namespace {

using physics::Effect;
using physics::Model;

// Held-out chi-squared per sample up to which a recording counts as explained: where the noise is
// declared, and where it had to be guessed from the recording itself.
constexpr double explained_declared = 1.3;
constexpr double explained_estimated = 3.0;
// A term is claimed when its held-out gain is this many standard errors (over windows) above 0
// (or, where the noise is declared, this many nats even without its best window), ...
constexpr double claim_z = 3.3;
constexpr double claim_nats = 10.0;
// ... and it takes at least this share of what chi-squared has above 1 (or of 1, where it has
// less). Where a good deal stays unexplained, a small share is no evidence: any term can soak up a
// little of what another physics left.
constexpr double claim_share_explained = 0.05;
constexpr double claim_share_unexplained = 0.3;
constexpr std::size_t most_findings = 3;
constexpr std::size_t finalists = 5;
constexpr std::size_t unlisted_finalists = 2;  // beside them
constexpr std::size_t started_anew = 2;        // of those, where none explains the recording
// What the contract lists, and a formula rather than a drawn shape, is preferred to what is not as
// long as it gains nearly as much: a shape that may bend anywhere can imitate most of the others.
constexpr double nearly_as_much = 0.85;
// A law with a parameter or a hidden state more can always imitate the one that lacks it: it has to
// gain at least this share more.
constexpr double no_clear_gain = 0.15;
// Two that are listed, and that explain the recording, are preferred to a drawn shape as long as
// they gain this share of what it gains.
constexpr double two_for_a_shape = 0.6;
// Every candidate is first fitted roughly: on so many windows spread over the recording, in so many
// iterations, with longer steps.
constexpr std::size_t rough_windows = 20;
constexpr int glance_iterations = 1;
constexpr std::size_t looked_at_again = 16;
constexpr int rough_iterations = 2;
constexpr std::size_t looked_at_thrice = 9;  // of those the best, until they have settled
constexpr int settling_iterations = 4;
// A finalist whose cost is this many times that of the best is not fitted to its end.
constexpr double hopeless = 3.0;
// A single effect that takes this share of what is unexplained imitates no pair.
constexpr double nearly_all = 0.95;
// What calibrated parameters cost (see HeldOut::strain) beyond which they are not believed: of nine
// that are within their sigma, once in 100000 recordings.
constexpr double strained = 20.0;
// An estimate of the noise is confirmed by a typical window within this factor (a logarithm).
constexpr double confirmed = 0.2;
// A finding with less probability than this comes with the experiment that would tell.
constexpr double sure = 0.95;
// No more is looked for once held-out chi-squared is this close to what noise alone gives.
constexpr double at_the_floor = 1.1;
// A fit that ends further above it than this may not have found the deepest valley.
constexpr double near_the_floor = 1.3;

// Whether `is` says so of any channel of any recording that a model is compared with.
template <class Is>
bool any_compared(std::span<const Experiment> experiments, Is&& is) {
  for (const Experiment& e : experiments) {
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (((e.compared >> c) & 1U) != 0 && is(e, c)) return true;
    }
  }
  return false;
}

bool noise_is_declared(std::span<const Experiment> experiments) {
  return !any_compared(experiments,
                       [](const Experiment& e, std::size_t c) { return !e.noise_declared[c]; });
}

bool noise_is_assumed(std::span<const Experiment> experiments) {
  return any_compared(experiments,
                      [](const Experiment& e, std::size_t c) { return e.noise_assumed[c]; });
}

Task task_for(const std::vector<Experiment>& experiments, bool held_out, int threads) {
  Task task;
  task.experiments = experiments;
  task.sigma = noise_sigma(experiments);
  task.threads = threads;
  for (std::size_t i = 0; i < experiments.size(); ++i) {
    for (std::size_t w = 0; w < experiments[i].windows.size(); ++w) {
      if (experiments[i].windows[w].held_out == held_out) task.windows.push_back({i, w});
    }
  }
  return task;
}

// How badly a window is predicted, so that neither one wild window nor a wrong noise level decides:
// half the log-likelihood of a residual whose scale is not known better than the noise.
// Every free state of a window counts one against the hypothesis that has it.
double window_loss(double chi2, int count, int states) {
  return 0.5 * count * std::log1p(chi2 / std::max(1, count)) + states;
}

struct HeldOut {
  std::vector<double> loss;  // by window
  double chi2 = 0.0;         // per sample, states refitted
  double typical = 0.0;      // the same of the median window
  double strain = 0.0;       // what it costs to believe the calibrated parameters: half the sum of
                        // squares of their distances from the declared values, in sigma; 0 where
                        // the noise is not known, and losses are no likelihoods
};

// Where the noise is known, the refitted windows decide: their residuals are white when nothing
// is missing, and every nat counts. Where it is not, every model is wrong by more than noise, and a
// hypothesis could buy a better fit with hidden states that each window chooses anew; there the
// errors of predictions ahead decide.
HeldOut held_out_of(const Task& task, const Hypothesis& hypothesis, std::span<const double> z,
                    bool noise_is_known) {
  FitOptions states_only;
  states_only.parameters_free = false;
  states_only.iterations = 12;
  states_only.tolerance = 1.0e-3;
  const Fit fitted = fit_states(task, hypothesis, z, states_only);
  HeldOut out;
  out.chi2 = fitted.chi2_per_sample();
  std::vector<double> by_window;
  for (std::size_t w = 0; w < fitted.chi2.size(); ++w) {
    by_window.push_back(fitted.chi2[w] / std::max(1, fitted.count[w] - fitted.states_per_window));
  }
  out.typical = median(std::move(by_window));
  if (noise_is_known) {
    for (std::size_t w = 0; w < fitted.chi2.size(); ++w) {
      out.loss.push_back(window_loss(fitted.chi2[w], fitted.count[w], fitted.states_per_window));
    }
  } else {
    const Ahead ahead = predict_ahead(task, hypothesis, z);
    for (std::size_t w = 0; w < ahead.chi2.size(); ++w) {
      out.loss.push_back(window_loss(ahead.chi2[w], ahead.count[w], 0));
    }
  }
  return out;
}

// How sure it is that the mean gain over windows is positive, as the equivalent number of standard
// deviations of a normal distribution. Windows are the independent units: samples within one share
// its state and are not. Student's t becomes a normal deviate by Wallace's formula (1959), so that
// few windows cannot claim what only many can.
double gain_z(const HeldOut& before, const HeldOut& after) {
  const std::size_t n = before.loss.size();
  if (n < 2) return 0.0;
  double mean = 0.0;
  for (std::size_t w = 0; w < n; ++w) mean += before.loss[w] - after.loss[w];
  mean /= static_cast<double>(n);
  double square = 0.0;
  for (std::size_t w = 0; w < n; ++w) {
    const double off = before.loss[w] - after.loss[w] - mean;
    square += off * off;
  }
  const double error = std::sqrt(square / static_cast<double>(n * (n - 1)));
  if (!(error > 0.0)) return 0.0;
  const double t = mean / error;
  const double freedom = static_cast<double>(n - 1);
  const double z = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0) *
                   std::sqrt(freedom * std::log1p(t * t / freedom));
  return t > 0.0 ? z : -z;
}

// Channels whose noise is not declared are weighed by what the fit leaves in them in a typical
// window (the median), so that a mistaken estimate of their noise does not decide between them and
// the others, and so that windows which a hypothesis cannot follow do not bend its parameters.
void reweigh(Task& task, const Hypothesis& hypothesis, const Fit& fitted) {
  std::array<std::vector<double>, predicted_channels> mean_square;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    const WindowRef ref = task.windows[w];
    const Experiment& e = task.experiments[ref.experiment];
    const Window& window = e.windows[ref.window];
    const auto readings = predict(e, window, window.end, hypothesis, fitted.z, fitted.state[w]);
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      double sum = 0.0;
      double samples = 0.0;
      for (std::size_t k = window.begin; k < window.end; ++k) {
        if (((e.valid[k] >> c) & 1U) == 0) continue;
        const double error = readings[k - window.begin][c] - e.reading[k][c];
        sum += error * error;
        samples += 1.0;
      }
      if (samples > 0.0 && std::isfinite(sum)) mean_square[c].push_back(sum / samples);
    }
  }
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    const bool declared = std::any_of(task.experiments.begin(), task.experiments.end(),
                                      [c](const Experiment& e) { return e.noise_declared[c]; });
    if (declared || mean_square[c].empty()) continue;
    task.sigma[c] =
        std::max(noise_sigma(task.experiments)[c], std::sqrt(median(std::move(mean_square[c]))));
  }
}

// Whether the gain is certain although few windows show it, as where an effect matters at large
// amplitudes only and the spread over windows says nothing. Only where the noise is known: there
// a window's loss is a likelihood, a nat is worth what it says, and a needless parameter gains
// none. One window alone proves nothing, and hardly any may be predicted worse.
bool gain_is_plain(const HeldOut& before, const HeldOut& after) {
  double gained = 0.0;
  double lost = 0.0;
  double most = 0.0;
  for (std::size_t w = 0; w < before.loss.size(); ++w) {
    const double gain = before.loss[w] - after.loss[w];
    (gain > 0.0 ? gained : lost) += std::abs(gain);
    most = std::max(most, gain);
  }
  return gained - most - lost > claim_nats && lost < 0.1 * gained;
}

struct Candidate {
  Suspect suspect;
  std::optional<Hypothesis> hypothesis;
  Fit fitted;
  HeldOut held_out;
  double z = 0.0;
};

// Of a fit that only has to tell candidates apart.
FitOptions quickly(int iterations) {
  FitOptions options;
  options.iterations = iterations;
  options.tolerance = 1.0e-2;
  options.rescue = false;
  options.covariance = false;
  return options;
}

Fit fit_in_stages(const Task& task, const Hypothesis& hypothesis, const std::vector<double>& z,
                  const std::vector<WindowState>& states, int iterations) {
  // First the beginning of each window, where even a wrong model has not yet lost the motion.
  Task beginning = task;
  beginning.share = 0.35;
  const Fit first = fit(beginning, hypothesis, z, states, quickly(3));
  FitOptions all;
  all.iterations = iterations;
  if (iterations <= rough_iterations) all = quickly(iterations);
  return fit(task, hypothesis, first.z, first.state, all);
}

// One for a parameter that the physics is not there without, two for a hidden state that every
// window starts free, and three for physics that nobody has found worth a name.
double complexity(const Candidate& candidate) {
  double parameters = 0.0;
  for (const physics::Term& term : candidate.hypothesis->model().terms) {
    for (const physics::ParameterCard& card : physics::find_effect(term.id)->card().parameters) {
      if (!card.fixed_default) parameters += 1.0;
    }
  }
  return 2.0 * candidate.fitted.states_per_window + parameters +
         (candidate.suspect.effect == nullptr || candidate.suspect.effect->card().depends_on.empty()
              ? 0.0
              : 3.0);
}

// 0: listed by the contract, 1: a formula that it does not list, 2: a drawn shape.
int tier(const Suspect& suspect) { return static_cast<int>(suspect.effect->card().tier); }

// Whether the effect replaces a law instead of bending it: a single step from the law without it
// says little.
bool replaces_a_law(const Candidate& base, const Candidate& candidate) {
  const auto& a = base.hypothesis->rig().structure();
  const auto& b = candidate.hypothesis->rig().structure();
  return a.kinetics != b.kinetics || a.resonant != b.resonant || a.friction != b.friction ||
         candidate.hypothesis->rig().state_count() != base.hypothesis->rig().state_count();
}

bool are_rivals(const Suspect& one, const Suspect& other) {
  const Effect& a = *one.effect;
  const Effect& b = *other.effect;
  const auto names = [](const Effect& one, const Effect& other) {
    const auto& rivals = one.card().rivals;
    return std::find(rivals.begin(), rivals.end(), other.card().id) != rivals.end();
  };
  return names(a, b) || names(b, a);
}

// From where a hypothesis that adds to `current` is searched: from the fit so far, and from the
// declared values where lacking physics has pulled that fit far away from them.
std::vector<std::vector<double>> starting_points(const Candidate& current,
                                                 const Hypothesis& hypothesis) {
  std::vector<double> z = current.fitted.z;
  double farthest = 0.0;
  for (std::size_t u = 0; u < z.size(); ++u) {
    if (current.hypothesis->unknowns()[u].of_model) farthest = std::max(farthest, std::abs(z[u]));
  }
  z.resize(hypothesis.unknowns().size(), 0.0);
  std::vector<std::vector<double>> points{z};
  if (farthest > 2.0) {
    for (std::size_t u = 0; u < z.size(); ++u) {
      if (hypothesis.unknowns()[u].of_model) z[u] = 0.0;
    }
    points.push_back(z);
  }
  return points;
}

// Weights of the candidates by the Bayesian bootstrap over held-out windows: how often, and by how
// much, each would come out best if the windows were drawn anew.
std::vector<double> probabilities(const std::vector<Candidate>& candidates, std::uint64_t seed) {
  const std::size_t n = candidates.front().held_out.loss.size();
  std::vector<double> weight(candidates.size(), 0.0);
  std::mt19937_64 random(seed);
  std::exponential_distribution<double> exponential(1.0);
  constexpr int draws = 2000;
  std::vector<double> share(n);
  std::vector<double> total(candidates.size());
  for (int draw = 0; draw < draws; ++draw) {
    double sum = 0.0;
    for (double& each : share) sum += each = exponential(random);
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      total[k] = candidates[k].held_out.strain;
      for (std::size_t w = 0; w < n; ++w) {
        total[k] += share[w] / sum * static_cast<double>(n) * candidates[k].held_out.loss[w];
      }
    }
    const double best = *std::min_element(total.begin(), total.end());
    double normal = 0.0;
    for (const double each : total) normal += std::exp(best - each);
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      weight[k] += std::exp(best - total[k]) / normal / draws;
    }
  }
  // Occam: every parameter and hidden state more is a priori that much less likely.
  double sum = 0.0;
  for (std::size_t k = 0; k < weight.size(); ++k) {
    weight[k] *= std::exp(complexity(candidates.front()) - complexity(candidates[k]));
    sum += weight[k];
  }
  for (double& each : weight) each /= sum;
  return weight;
}

// Where the parameters of the candidate's own effect stand among those of its rig, in the order of
// its card.
std::vector<std::size_t> places_of(const Candidate& candidate) {
  const physics::Term term{std::string(candidate.suspect.effect->card().id),
                           candidate.suspect.place.channel,
                           {},
                           candidate.suspect.place.from};
  const std::string prefix = physics::path_of(term) + ".";
  const auto& paths = candidate.hypothesis->rig().parameter_paths();
  std::vector<std::size_t> places;
  for (const physics::ParameterCard& card : candidate.suspect.effect->card().parameters) {
    places.push_back(static_cast<std::size_t>(
        std::find(paths.begin(), paths.end(), prefix + std::string(card.name)) - paths.begin()));
  }
  return places;
}

std::vector<double> by_card_of(const Candidate& candidate) {
  const auto values = candidate.hypothesis->parameters(candidate.fitted.z);
  std::vector<double> by_card;
  for (const std::size_t place : places_of(candidate)) by_card.push_back(values[place]);
  return by_card;
}

// How uncertain the unknown `u` is, which is the k-th parameter of an effect's card: by what noise
// does to the fit, and because the formula itself is only so good. In z.
double doubt_of(const Hypothesis& hypothesis, const Fit& fitted, double inflation, std::size_t u,
                const physics::ParameterCard& card) {
  const auto i = static_cast<Eigen::Index>(u);
  const double value = hypothesis.value(u, fitted.z[u]);
  const double doubt = card.formula_uncertainty * std::abs(value - card.neutral);
  const double slope = std::max(std::abs(hypothesis.slope(u, fitted.z[u])), 1.0e-300);
  return std::hypot(inflation * std::sqrt(std::max(0.0, fitted.covariance(i, i))), doubt / slope);
}

Finding finding_of(const Candidate& candidate, const Fit& fitted, double inflation) {
  Finding finding;
  finding.effect = candidate.suspect.effect;
  finding.place = candidate.suspect.place;
  const Hypothesis& hypothesis = *candidate.hypothesis;
  const auto values = hypothesis.parameters(fitted.z);
  const Effect& effect = *candidate.suspect.effect;
  const auto places = places_of(candidate);
  std::vector<double> by_card;
  for (std::size_t k = 0; k < places.size(); ++k) {
    const physics::ParameterCard& card = effect.card().parameters[k];
    const std::size_t at = places[k];
    by_card.push_back(values[at]);
    for (std::size_t u = 0; u < hypothesis.unknowns().size(); ++u) {
      if (hypothesis.unknowns()[u].parameter != at) continue;
      const double half = 1.96 * doubt_of(hypothesis, fitted, inflation, u, card);
      const double low = hypothesis.value(u, fitted.z[u] - half);
      const double high = hypothesis.value(u, fitted.z[u] + half);
      finding.parameters.push_back(
          {std::string(card.name), values[at], std::min(low, high), std::max(low, high)});
    }
  }
  finding.statement = effect.statement(by_card);
  return finding;
}

// What was fitted, drawn, with the interval that follows from all parameters of the effect.
std::vector<Curve> portrait_with_bands(const Candidate& candidate, const Fit& fitted,
                                       double inflation, const Experiment& experiment) {
  const Hypothesis& hypothesis = *candidate.hypothesis;
  const Effect& effect = *candidate.suspect.effect;
  const auto places = places_of(candidate);
  const auto like = by_card_of(candidate);
  const Model model = hypothesis.model_at(fitted.z);
  const double friction_n =
      model.friction.mu.value * (model.normal_load ? experiment.mean_load_n : 1.0);
  const auto at = [&](const std::vector<double>& values) {
    return portrait_of(effect, candidate.suspect.place, values, like, experiment, friction_n);
  };
  std::vector<std::size_t> unknown;
  std::vector<std::size_t> of_card;
  for (std::size_t k = 0; k < places.size(); ++k) {
    for (std::size_t u = 0; u < hypothesis.unknowns().size(); ++u) {
      if (hypothesis.unknowns()[u].parameter != places[k]) continue;
      unknown.push_back(u);
      of_card.push_back(k);
    }
  }
  const auto n = static_cast<Eigen::Index>(unknown.size());
  std::vector<double> sigma;
  for (std::size_t i = 0; i < unknown.size(); ++i) {
    sigma.push_back(std::max(
        doubt_of(hypothesis, fitted, inflation, unknown[i], effect.card().parameters[of_card[i]]),
        1.0e-300));
  }
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      if (i == j) continue;
      const auto a = static_cast<std::size_t>(i);
      const auto b = static_cast<std::size_t>(j);
      correlation(i, j) = inflation * inflation *
                          fitted.covariance(static_cast<Eigen::Index>(unknown[a]),
                                            static_cast<Eigen::Index>(unknown[b])) /
                          (sigma[a] * sigma[b]);
    }
  }
  std::vector<Curve> curves = at(like);
  add_bands(curves, correlation, [&](Eigen::Index i, double by) {
    const auto k = static_cast<std::size_t>(i);
    std::vector<double> values = like;
    values[of_card[k]] = hypothesis.value(unknown[k], fitted.z[unknown[k]] + by * sigma[k]);
    return at(values);
  });
  return curves;
}

double total_loss(const HeldOut& held_out) {
  return std::accumulate(held_out.loss.begin(), held_out.loss.end(), held_out.strain);
}
double total_loss(const Candidate& candidate) { return total_loss(candidate.held_out); }

// Whether the recording says anything about each number that makes the effect what it is. A
// hysteresis whose slip force may be anything has not been seen to slip: it stands in for something
// else, here for a spring.
bool is_determined(const Candidate& candidate) {
  constexpr double undetermined = 2.5;  // of a logarithm; the prior has 4
  const auto& unknowns = candidate.hypothesis->unknowns();
  const auto size = static_cast<Eigen::Index>(unknowns.size());
  if (candidate.fitted.covariance.rows() != size) return true;  // not fitted to its end
  for (const std::size_t place : places_of(candidate)) {
    for (Eigen::Index u = 0; u < size; ++u) {
      const Unknown& unknown = unknowns[static_cast<std::size_t>(u)];
      if (unknown.parameter != place || !unknown.logarithmic || unknown.refinement) continue;
      const double error = std::sqrt(std::max(0.0, candidate.fitted.covariance(u, u)));
      if (unknown.scale * error > undetermined) return false;
    }
  }
  return true;
}

// Adds one physics after the other to the declared model for as long as held-out data say so.
class Search {
 public:
  // `rough` are the same experiments, with longer steps.
  Search(const std::vector<Experiment>& experiments, const std::vector<Experiment>& rough,
         const Options& options)
      : experiments_(experiments),
        rough_(rough),
        options_(options),
        noise_is_known_(noise_is_declared(experiments)),
        limit_(noise_is_known_ ? explained_declared : explained_estimated),
        train_(task_for(experiments, false, options.threads)),
        held_(task_for(experiments, true, options.threads)) {}

  // A physics that was claimed, with those it was chosen from (itself first).
  struct Claim {
    Suspect suspect;
    std::vector<Candidate> rivals;
    double chi2_before = 0.0;
    double chi2_after = 0.0;
  };

  void run(const Model& model) {
    say("calibrating the declared model", 0.0);
    null_.hypothesis.emplace(model);
    const std::vector<double> origin(null_.hypothesis->unknowns().size(), 0.0);
    null_.fitted = fit_in_stages(train_, *null_.hypothesis, origin,
                                 guessed_states(train_, *null_.hypothesis), 14);
    train_.base_response =
        base_response_of(train_, *null_.hypothesis, null_.fitted.z, null_.fitted.state);
    settle(null_);
    null_train_ = train_;
    current_ = null_;
    look_for_hints();
    while (claims_.size() < most_findings && add_one()) {
    }
    while (claims_.size() > 1 && drop_one()) {
    }
  }

  const Candidate& null() const { return null_; }
  const Candidate& result() const { return current_; }
  const std::vector<Claim>& claims() const { return claims_; }
  const std::vector<Trial>& trials() const { return trials_; }
  const Task& held() const { return held_; }
  const Task& null_train() const { return null_train_; }
  double limit() const { return limit_; }
  // Whether what was found needs calibrated parameters that nobody would believe.
  bool is_strained() const { return current_.held_out.strain > strained; }
  // What would have been named beside what was.
  Detection detection() const {
    Few few = few_of(current_);
    few.task.threads = options_.threads;
    Fit fitted;
    fitted.z = current_.fitted.z;
    fitted.state = few.state;
    std::vector<Suspect> suspects = suspects_of(current_.hypothesis->model(), experiments_);
    std::erase_if(suspects, [](const Suspect& each) { return tier(each) > 1; });
    const auto scales = [&](const physics::Place& place) {
      return scales_of(experiments_, *current_.hypothesis, current_.fitted.z, hints_, place);
    };
    return detection_of(few.task, *current_.hypothesis, fitted, suspects, scales,
                        claim_share_explained);
  }
  // The relation of the best candidate that was not claimed either, for want of better.
  std::optional<physics::Relation> suspected() const { return suspected_; }

 private:
  void say(const std::string& what, double share) const {
    if (!options_.progress) return;
    const double stages = most_findings + 1.0;
    options_.progress(what, 0.05 + 0.85 * (static_cast<double>(claims_.size()) + share) / stages);
  }

  // What the current model leaves unexplained, over all windows, fitted and held out.
  void look_for_hints() {
    Task whole = train_;
    whole.windows.insert(whole.windows.end(), held_.windows.begin(), held_.windows.end());
    std::sort(whole.windows.begin(), whole.windows.end(),
              [](const WindowRef& a, const WindowRef& b) {
                return std::pair(a.experiment, a.window) < std::pair(b.experiment, b.window);
              });
    FitOptions states_only;
    states_only.parameters_free = false;
    states_only.iterations = 6;
    states_only.rescue = false;
    whole.base_response.clear();
    const Fit fitted = fit(whole, *current_.hypothesis, current_.fitted.z,
                           guessed_states(whole, *current_.hypothesis), states_only);
    hints_ = hints_of(whole, *current_.hypothesis, fitted);
  }

  // Once a fit has come near the estimated noise, what is left over tells of the hypothesis and no
  // longer of the estimate: the last steps are taken in units of the noise itself.
  void trust_the_estimate(Task& task, Candidate& candidate, const FitOptions& options) const {
    constexpr double near = 3.0;
    const auto noise = noise_sigma(experiments_);
    bool changed = false;
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (task.sigma[c] > near * noise[c]) return;
      changed = changed || task.sigma[c] > noise[c];
    }
    if (!changed) return;
    task.sigma = noise;
    candidate.fitted =
        fit(task, *candidate.hypothesis, candidate.fitted.z, candidate.fitted.state, options);
  }

  // The fit brought to its end with weights that suit it, and scored.
  void settle(Candidate& candidate) {
    reweigh(train_, *candidate.hypothesis, candidate.fitted);
    candidate.fitted =
        fit(train_, *candidate.hypothesis, candidate.fitted.z, candidate.fitted.state);
    trust_the_estimate(train_, candidate, {});
    candidate.held_out = held_out(candidate);
    // An estimate of the noise that a model follows half of the windows down to is right: nothing
    // but noise would leave just that.
    if (!noise_is_known_ && !noise_is_assumed(experiments_) &&
        std::abs(std::log(candidate.held_out.typical)) < confirmed) {
      noise_is_known_ = true;
      limit_ = explained_declared;
      candidate.held_out = held_out(candidate);
    }
  }

  HeldOut held_out(const Candidate& candidate) const {
    const auto& z = candidate.fitted.z;
    HeldOut out = held_out_of(held_, *candidate.hypothesis, z, noise_is_known_);
    for (std::size_t u = 0; u < z.size() && noise_is_known_; ++u) {
      if (candidate.hypothesis->unknowns()[u].of_model) out.strain += 0.5 * z[u] * z[u];
    }
    return out;
  }

  // A few of the windows to fit, their states as `base` has them: half spread over the recording,
  // half where it fails most.
  struct Few {
    Task task;
    std::vector<std::size_t> window;  ///< index into train_.windows
    std::vector<WindowState> state;
  };
  Few few_of(const Candidate& base) const {
    const std::size_t all = train_.windows.size();
    std::vector<std::size_t> worst(all);
    std::iota(worst.begin(), worst.end(), std::size_t{0});
    const auto excess = [&](std::size_t w) {
      return base.fitted.chi2[w] / std::max(1, base.fitted.count[w]);
    };
    std::stable_sort(worst.begin(), worst.end(),
                     [&](std::size_t a, std::size_t b) { return excess(a) > excess(b); });
    std::vector<bool> chosen(all, false);
    const std::size_t count = std::min(all, rough_windows);
    for (std::size_t i = 0; i < count / 2; ++i) chosen[i * all / (count / 2)] = true;
    std::size_t left = count - count / 2;
    for (std::size_t i = 0; i < all && left > 0; ++i) {
      if (chosen[worst[i]]) continue;
      chosen[worst[i]] = true;
      --left;
    }
    Few few;
    few.task = train_;
    few.task.experiments = rough_;
    few.task.windows.clear();
    few.task.base_response.clear();
    few.task.threads = 1;
    for (std::size_t w = 0; w < all; ++w) {
      if (!chosen[w]) continue;
      few.window.push_back(w);
      few.task.windows.push_back(train_.windows[w]);
      if (!train_.base_response.empty()) few.task.base_response.push_back(train_.base_response[w]);
      few.state.push_back(base.fitted.state[w]);
    }
    return few;
  }

  // `suspect` added to `base`, from its best start, fitted on a few windows in a few iterations.
  Candidate tried(const Candidate& base, const Suspect& suspect, const Few& few) const {
    Candidate best;
    best.suspect = suspect;
    const auto scales =
        scales_of(experiments_, *base.hypothesis, base.fitted.z, hints_, suspect.place);
    const auto fixed = suspect.effect->fixed(scales);
    FitOptions glance;
    glance.iterations = glance_iterations;
    glance.covariance = false;
    glance.rescue = false;
    for (const auto& start : suspect.effect->starts(scales)) {
      const Hypothesis hypothesis =
          base.hypothesis->with(*suspect.effect, suspect.place, start, fixed, Detail::coarse);
      const auto points = starting_points(base, hypothesis);
      for (std::size_t i = 0; i < points.size(); ++i) {
        // From the declared values the windows start anew too.
        Fit fitted = fit(few.task, hypothesis, points[i],
                         i == 0 ? carried(few.state, few.task, *base.hypothesis, hypothesis)
                                : guessed_states(few.task, hypothesis),
                         glance);
        if (!best.hypothesis || fitted.cost < best.fitted.cost) {
          best.hypothesis.emplace(hypothesis);
          best.fitted = std::move(fitted);
        }
      }
    }
    return best;
  }

  // The same, fitted about as well as those windows allow.
  static void look_again(const Few& few, Candidate& candidate) {
    candidate.fitted = fit_in_stages(few.task, *candidate.hypothesis, candidate.fitted.z,
                                     candidate.fitted.state, rough_iterations);
  }
  static void let_settle(const Few& few, Candidate& candidate) {
    candidate.fitted = fit(few.task, *candidate.hypothesis, candidate.fitted.z,
                           candidate.fitted.state, quickly(settling_iterations));
  }

  // The windows that were not among the few start from where `base` had them.
  void spread_out(const Candidate& base, const Few& few, Candidate& candidate) const {
    std::vector<WindowState> states =
        carried(base.fitted.state, train_, *base.hypothesis, *candidate.hypothesis);
    for (std::size_t i = 0; i < few.window.size(); ++i) {
      states[few.window[i]] = candidate.fitted.state[i];
    }
    candidate.fitted.state = std::move(states);
  }

  // Everybody that could be missing from `base`: at a glance, and the best of them once more; best
  // first.
  std::vector<Candidate> all_tried(const Candidate& base, double share_begin, double share_end,
                                   bool only_listed = false) const {
    std::vector<Suspect> suspects = suspects_of(base.hypothesis->model(), experiments_);
    if (only_listed) std::erase_if(suspects, [](const Suspect& each) { return tier(each) > 0; });
    const Few few = few_of(base);
    std::vector<Candidate> glanced(suspects.size());
    say("trying " + std::to_string(suspects.size()) + " effects", share_begin);
    parallel::for_each(suspects.size(), options_.threads,
                       [&](std::size_t i) { glanced[i] = tried(base, suspects[i], few); });
    std::vector<Candidate> candidates;
    for (Candidate& each : glanced) {
      if (each.hypothesis) candidates.push_back(std::move(each));
    }
    const auto cheaper = [](const Candidate& a, const Candidate& b) {
      return a.fitted.cost + complexity(a) < b.fitted.cost + complexity(b);
    };
    std::stable_sort(candidates.begin(), candidates.end(), cheaper);
    // The best of them, and all that a glance cannot judge.
    std::size_t kept = std::min(candidates.size(), looked_at_again);
    for (std::size_t i = kept; i < candidates.size(); ++i) {
      if (replaces_a_law(base, candidates[i])) std::swap(candidates[kept++], candidates[i]);
    }
    candidates.erase(candidates.begin() + static_cast<std::ptrdiff_t>(kept), candidates.end());
    say("trying the best again", 0.5 * (share_begin + share_end));
    parallel::for_each(candidates.size(), options_.threads,
                       [&](std::size_t i) { look_again(few, candidates[i]); });
    std::stable_sort(candidates.begin(), candidates.end(), cheaper);
    parallel::for_each(std::min(looked_at_thrice, candidates.size()), options_.threads,
                       [&](std::size_t i) { let_settle(few, candidates[i]); });
    std::stable_sort(candidates.begin(), candidates.end(), cheaper);
    for (Candidate& each : candidates) spread_out(base, few, each);
    return candidates;
  }

  // Fits candidates with weights of their own, those that are not hopeless to the end, and scores
  // them against the current model.
  void finish(std::span<Candidate> candidates) {
    double least_cost = std::numeric_limits<double>::infinity();
    for (Candidate& each : candidates) {
      each.fitted = fit(train_, *each.hypothesis, each.fitted.z, each.fitted.state, quickly(4));
      // What follows a recording more closely than its noise lets it is no better for it.
      const double samples =
          std::accumulate(each.fitted.count.begin(), each.fitted.count.end(), 0.0);
      least_cost = std::min(least_cost, std::max(each.fitted.cost, samples));
    }
    for (Candidate& each : candidates) {
      if (each.fitted.cost <= hopeless * least_cost) fit_to_the_end(each);
      each.held_out = held_out(each);
      each.z = gain_z(current_.held_out, each.held_out);
    }
  }

  void fit_to_the_end(Candidate& candidate) const {
    Task own = train_;
    const Hypothesis refined = candidate.hypothesis->refined();
    candidate.hypothesis.emplace(refined);
    candidate.fitted.z.resize(refined.unknowns().size(), 0.0);
    own.base_response =
        base_response_of(own, *candidate.hypothesis, candidate.fitted.z, candidate.fitted.state);
    reweigh(own, *candidate.hypothesis, candidate.fitted);
    FitOptions options;
    options.tolerance = 1.0e-3;
    options.iterations = 8;
    candidate.fitted =
        fit(own, *candidate.hypothesis, candidate.fitted.z, candidate.fitted.state, options);
    options.rescue = false;
    trust_the_estimate(own, candidate, options);
  }

  // A fit that ends far above the noise may sit in a valley that is not the deepest, where
  // calibrated parameters and refinements stand in for each other. Where none of the candidates
  // explains the recording, the best of them start anew: declared values, fresh window states, no
  // refinements, only the size of what is on trial as it was found.
  void start_anew(std::span<Candidate> candidates) {
    const auto explains = [](const Candidate& each) { return each.held_out.chi2 < near_the_floor; };
    if (std::any_of(candidates.begin(), candidates.end(), explains)) return;
    std::vector<Candidate*> best;
    for (Candidate& each : candidates) {
      if (tier(each.suspect) < 2) best.push_back(&each);  // a drawn shape has no valley of its own
    }
    std::stable_sort(best.begin(), best.end(), [](const Candidate* a, const Candidate* b) {
      return total_loss(*a) < total_loss(*b);
    });
    for (Candidate* each : std::span(best).first(std::min(best.size(), started_anew))) {
      Candidate fresh = *each;
      const Hypothesis hypothesis = unrefined(*each);
      fresh.hypothesis.emplace(hypothesis);
      fresh.fitted =
          fit_in_stages(train_, hypothesis, std::vector<double>(hypothesis.unknowns().size(), 0.0),
                        guessed_states(train_, hypothesis), rough_iterations);
      finish({&fresh, 1});
      if (total_loss(fresh) < total_loss(*each)) *each = std::move(fresh);
    }
  }

  // The hypothesis of `candidate` with the sizes that were found as centres, and without
  // refinements.
  Hypothesis unrefined(const Candidate& candidate) const {
    const physics::Model found = candidate.hypothesis->model_at(candidate.fitted.z);
    const physics::Model& begun = candidate.hypothesis->model();
    std::optional<Hypothesis> out(*null_.hypothesis);
    for (std::size_t t = out->model().terms.size(); t < found.terms.size(); ++t) {
      const physics::Term& term = found.terms[t];
      const Effect& effect = *physics::find_effect(term.id);
      std::vector<double> values;
      for (const physics::ParameterCard& card : effect.card().parameters) {
        const physics::Model& from = card.fixed_default ? begun : found;
        values.push_back(from.terms[t].parameters.at(std::string(card.name)).value);
      }
      const Hypothesis longer =
          out->with(effect, {term.channel, term.from}, values, {}, Detail::coarse);
      out.emplace(longer);
    }
    return *out;
  }

  bool is_gain(const HeldOut& before, const HeldOut& after) const {
    // Parameters far beyond their sigma are missing physics too, however well they predict.
    if (before.strain - after.strain > strained &&
        total_loss(before) - total_loss(after) > strained) {
      return true;
    }
    const double excess = std::max(before.chi2 - 1.0, 1.0);
    const double share = after.chi2 <= limit_ ? claim_share_explained : claim_share_unexplained;
    const bool certain =
        gain_z(before, after) > claim_z || (noise_is_known_ && gain_is_plain(before, after));
    return certain && before.chi2 - after.chi2 > share * excess;
  }
  bool is_claimed(const Candidate& candidate) const {
    return is_gain(current_.held_out, candidate.held_out);
  }

  // Most probable first. A law with a parameter or a hidden state more can always imitate its
  // relative that lacks it: of declared rivals the simpler stands first as long as the other is not
  // clearly better.
  void rank(std::vector<Candidate>& candidates) const {
    const std::vector<double> weight = probabilities(candidates, options_.seed + claims_.size());
    std::vector<std::size_t> order(candidates.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      if (weight[a] != weight[b]) return weight[a] > weight[b];
      return total_loss(candidates[a]) < total_loss(candidates[b]);
    });
    std::vector<Candidate> sorted;
    sorted.reserve(order.size());
    for (const std::size_t k : order) sorted.push_back(std::move(candidates[k]));
    candidates = std::move(sorted);
    const Candidate& best = candidates.front();
    const double gain = total_loss(current_) - total_loss(best);
    std::size_t chosen = 0;
    for (std::size_t k = 1; k < candidates.size(); ++k) {
      if (are_rivals(best.suspect, candidates[k].suspect) &&
          complexity(candidates[k]) < complexity(candidates[chosen]) &&
          gain_z(candidates[k].held_out, best.held_out) < claim_z &&
          total_loss(candidates[k]) - total_loss(best) < no_clear_gain * gain) {
        chosen = k;
      }
    }
    // Of a better tier, the best that gains nearly as much; or that gains at all, where the unnamed
    // physics does not explain the recording either: of a real machine, what has a name comes
    // first.
    const double enough = total_loss(current_) - nearly_as_much * gain;
    const bool explained = candidates[chosen].held_out.chi2 <= limit_;
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      if (tier(candidates[k].suspect) >= tier(candidates[chosen].suspect)) continue;
      const bool nearly =
          total_loss(candidates[k]) < std::max(enough, total_loss(best) + claim_nats);
      if (nearly || (!explained && is_claimed(candidates[k]))) chosen = k;
    }
    std::rotate(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(chosen),
                candidates.begin() + static_cast<std::ptrdiff_t>(chosen) + 1);
  }

  void go_on_from(const Candidate& candidate) {
    current_ = candidate;
    train_.base_response =
        base_response_of(train_, *current_.hypothesis, current_.fitted.z, current_.fitted.state);
    settle(current_);
  }

  void claim(const Candidate& winner, std::vector<Candidate> rivals) {
    Claim claim;
    claim.suspect = winner.suspect;
    claim.rivals = std::move(rivals);
    claim.chi2_before = current_.held_out.chi2;
    go_on_from(winner);
    look_for_hints();
    claim.chi2_after = current_.held_out.chi2;
    claims_.push_back(std::move(claim));
  }

  // Whether what little is left looks like any one effect that the contract lists.
  bool something_pulls() const {
    if (!noise_is_known_ || current_.held_out.chi2 < 1.0 + claim_share_explained) return false;
    const Detection detection = this->detection();
    return std::any_of(detection.limits.begin(), detection.limits.end(),
                       [](const DetectionLimit& limit) {
                         return tier(limit.suspect) == 0 && limit.gain > claim_share_explained;
                       });
  }

  bool add_one() {
    if (!claims_.empty() && current_.held_out.chi2 < at_the_floor && !is_strained() &&
        !something_pulls()) {
      return false;
    }
    std::vector<Candidate> rough = all_tried(current_, 0.0, 0.5);
    if (rough.empty()) return false;
    std::vector<Candidate> candidates;
    std::size_t listed = 0;
    std::size_t unlisted = 0;
    for (Candidate& each : rough) {
      if (tier(each.suspect) == 0 ? listed++ < finalists : unlisted++ < unlisted_finalists) {
        candidates.push_back(std::move(each));
      }
    }
    say("scoring on held-out data", 0.55);
    finish(candidates);
    start_anew(candidates);
    for (const Candidate& candidate : candidates) {
      trials_.push_back({candidate.suspect.name(), static_cast<int>(claims_.size()),
                         candidate.held_out.chi2, candidate.z});
    }
    // What the recording does not determine goes, as long as anything is left.
    if (std::any_of(candidates.begin(), candidates.end(), is_determined)) {
      std::erase_if(candidates, [](const Candidate& each) { return !is_determined(each); });
    }
    rank(candidates);
    if (!suspected_) suspected_ = candidates.front().suspect.effect->card().relation;
    // Before unnamed physics is believed, two that have names are tried together.
    if (claims_.empty() && tier(candidates.front().suspect) > 0) {
      std::vector<Candidate> named;
      for (const Candidate& each : candidates) {
        if (tier(each.suspect) == 0) named.push_back(each);
      }
      // A formula that nobody listed is as simple as two names; a drawn shape is not.
      const double best = total_loss(candidates.front());
      const double gain = total_loss(current_) - best;
      const double enough = tier(candidates.front().suspect) > 1
                                ? total_loss(current_) - two_for_a_shape * gain
                                : best;
      // What leaves nothing but noise is not given up for what leaves more.
      const Left most{std::max(enough, best + claim_nats),
                      noise_is_known_ && candidates.front().held_out.chi2 < at_the_floor
                          ? at_the_floor
                          : limit_};
      if (!named.empty() && add_pair(named, most)) return true;
    }
    // What is explained needs no physics that nobody has named.
    const bool needless = !claims_.empty() && current_.held_out.chi2 <= limit_ && !is_strained() &&
                          tier(candidates.front().suspect) > 0;
    if (!needless && is_claimed(candidates.front())) {
      // Where no single effect explains the recording, two together are looked for before the best
      // of the single ones is believed: it may only imitate them.
      const double left = (candidates.front().held_out.chi2 - 1.0) / (null_.held_out.chi2 - 1.0);
      if (claims_.empty() && candidates.front().held_out.chi2 > limit_ && left > 1.0 - nearly_all &&
          add_pair(candidates, Left{total_loss(candidates.front()), limit_})) {
        return true;
      }
      const Candidate winner = candidates.front();
      claim(winner, std::move(candidates));
      return true;
    }
    if (current_.held_out.chi2 <= limit_ || !claims_.empty()) return false;
    return add_pair(candidates, std::nullopt);
  }

  // The declared model with all that was claimed but one, from where the fit stands; nothing where
  // the others cannot be without it.
  std::optional<Candidate> without(std::size_t dropped) const {
    Candidate candidate;
    candidate.suspect = claims_[dropped == 0 ? 1 : 0].suspect;
    candidate.hypothesis.emplace(*null_.hypothesis);
    const physics::Model model = current_.hypothesis->model_at(current_.fitted.z);
    const std::size_t first_term = model.terms.size() - claims_.size();
    for (std::size_t i = 0; i < claims_.size(); ++i) {
      if (i == dropped) continue;
      const Suspect& suspect = claims_[i].suspect;
      if (!physics::can_be_missing(*suspect.effect, candidate.hypothesis->model(), suspect.place)) {
        return std::nullopt;
      }
      std::vector<double> values;
      for (const physics::ParameterCard& card : suspect.effect->card().parameters) {
        values.push_back(model.terms[first_term + i].parameters.at(std::string(card.name)).value);
      }
      const Hypothesis longer =
          candidate.hypothesis->with(*suspect.effect, suspect.place, values, {});
      candidate.hypothesis.emplace(longer);
    }
    candidate.fitted.z.assign(candidate.hypothesis->unknowns().size(), 0.0);
    std::size_t to = 0;
    for (std::size_t u = 0; u < current_.fitted.z.size(); ++u) {
      if (current_.hypothesis->unknowns()[u].of_model)
        candidate.fitted.z[to++] = current_.fitted.z[u];
    }
    candidate.fitted.state = guessed_states(train_, *candidate.hypothesis);
    return candidate;
  }

  // An effect that was claimed first may have stood in for what was found after it: whatever is not
  // needed beside the others goes.
  bool drop_one() {
    say("trying to do without", 0.9);
    for (std::size_t i = 0; i < claims_.size(); ++i) {
      std::optional<Candidate> rest = without(i);
      if (!rest) continue;
      finish({&*rest, 1});
      if (is_gain(rest->held_out, current_.held_out)) continue;
      claims_.erase(claims_.begin() + static_cast<std::ptrdiff_t>(i));
      go_on_from(*rest);
      claims_.front().chi2_before = null_.held_out.chi2;
      claims_.back().chi2_after = current_.held_out.chi2;
      return true;
    }
    return false;
  }

  // What a hypothesis leaves unexplained on held-out data.
  struct Left {
    double loss;
    double chi2;
  };

  // Two effects that each gain little alone may explain much together: friction, say, and a
  // constant force that hides it in one direction.
  // `most_left`: only two that leave no more than this on held-out data are claimed; the second is
  // a listed one.
  bool add_pair(const std::vector<Candidate>& firsts, const std::optional<Left>& most_left) {
    const bool must_explain = most_left.has_value();
    std::vector<Candidate> pairs;  // the best for each first effect, by that effect's name
    std::vector<std::vector<Candidate>> seconds;  // what each was chosen from
    std::vector<std::vector<Candidate>> others;   // and what came next to those, roughly fitted
    const std::size_t count = std::min<std::size_t>(firsts.size(), 3);
    for (std::size_t i = 0; i < count; ++i) {
      const double share = 0.6 + 0.4 * static_cast<double>(i) / static_cast<double>(count);
      std::vector<Candidate> tried = all_tried(firsts[i], share, share + 0.1, must_explain);
      if (tried.empty()) continue;
      constexpr std::size_t looked_at = 2;
      std::vector<Candidate> best_two = tried;
      if (best_two.size() > looked_at) {
        best_two.erase(best_two.begin() + looked_at, best_two.end());
      }
      finish(best_two);
      start_anew(best_two);
      rank(best_two);
      pairs.push_back(best_two.front());
      pairs.back().suspect = firsts[i].suspect;
      tried.erase(tried.begin(),
                  tried.begin() + static_cast<std::ptrdiff_t>(std::min(looked_at, tried.size())));
      if (tried.size() > finalists - looked_at) {
        tried.erase(tried.begin() + finalists - looked_at, tried.end());
      }
      seconds.push_back(std::move(best_two));
      others.push_back(std::move(tried));
    }
    if (pairs.empty()) return false;
    std::size_t best = 0;
    for (std::size_t i = 1; i < pairs.size(); ++i) {
      if (total_loss(pairs[i]) < total_loss(pairs[best])) best = i;
    }
    // As among single effects: what begins simpler stands as long as the other is not clearly
    // better.
    const auto first_of = [&](const Candidate& pair) -> const Candidate& {
      return *std::find_if(firsts.begin(), firsts.end(),
                           [&](const Candidate& c) { return c.suspect == pair.suspect; });
    };
    const std::size_t lowest = best;
    const double gain = total_loss(current_) - total_loss(pairs[lowest]);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      if (are_rivals(pairs[i].suspect, pairs[lowest].suspect) &&
          complexity(first_of(pairs[i])) < complexity(first_of(pairs[best])) &&
          gain_z(pairs[i].held_out, pairs[lowest].held_out) < claim_z &&
          total_loss(pairs[i]) - total_loss(pairs[lowest]) < no_clear_gain * gain) {
        best = i;
      }
    }
    // Beside the first that won, the second meets as many rivals as if it had been looked for
    // alone.
    finish(others[best]);
    for (Candidate& other : others[best]) seconds[best].push_back(std::move(other));
    rank(seconds[best]);
    for (const Candidate& second : seconds[best]) {
      trials_.push_back({pairs[best].suspect.name() + " + " + second.suspect.name(),
                         static_cast<int>(claims_.size()) + 1, second.held_out.chi2, second.z});
    }
    const Candidate winner = seconds[best].front();
    if (!is_claimed(winner)) return false;
    if (must_explain &&
        (winner.held_out.chi2 > most_left->chi2 || total_loss(winner) > most_left->loss)) {
      return false;
    }
    const auto alone = std::find_if(firsts.begin(), firsts.end(), [&](const Candidate& c) {
      return c.suspect == pairs[best].suspect;
    });
    const double chi2_alone = alone->held_out.chi2;
    Claim first;
    first.suspect = pairs[best].suspect;
    first.chi2_before = current_.held_out.chi2;
    first.chi2_after = chi2_alone;
    std::rotate(pairs.begin(), pairs.begin() + static_cast<std::ptrdiff_t>(best),
                pairs.begin() + static_cast<std::ptrdiff_t>(best) + 1);
    first.rivals = std::move(pairs);
    claims_.push_back(std::move(first));
    claim(winner, std::move(seconds[best]));
    claims_.back().chi2_before = chi2_alone;
    return true;
  }

  const std::vector<Experiment>& experiments_;
  const std::vector<Experiment>& rough_;
  const Options& options_;
  bool noise_is_known_;  // declared, or estimated and confirmed
  double limit_;
  Task train_;
  Task held_;
  Task null_train_;
  Hints hints_;
  Candidate null_;
  Candidate current_;
  std::vector<Claim> claims_;
  std::vector<Trial> trials_;
  std::optional<physics::Relation> suspected_;
};

// The run that would tell the first of `rivals` from the most probable other: found by simulating
// what a bench can do, or, where no run of that kind tells, as the effect's card has it.
std::string experiment_between(const std::vector<Candidate>& rivals,
                               const std::vector<double>& weight, const Experiment& recorded,
                               double horizon_s, std::uint64_t seed, int threads) {
  std::size_t other = 1;
  for (std::size_t k = 2; k < rivals.size(); ++k) {
    if (weight[k] > weight[other]) other = k;
  }
  const auto separation =
      separation_of(recorded, {&*rivals.front().hypothesis, rivals.front().fitted.z},
                    {&*rivals[other].hypothesis, rivals[other].fitted.z}, horizon_s, seed, threads);
  return separation ? sentence_of(*separation)
                    : std::string(rivals.front().suspect.effect->card().experiment);
}

std::vector<Finding> findings_of(const Search& search, double horizon_s, std::uint64_t seed) {
  const Candidate& result = search.result();
  const double inflation = std::sqrt(std::max(1.0, result.fitted.chi2_per_sample()));
  std::vector<Finding> findings;
  for (const Search::Claim& claim : search.claims()) {
    Candidate named = result;
    named.suspect = claim.suspect;
    Finding finding = finding_of(named, result.fitted, inflation);
    finding.chi2_before = claim.chi2_before;
    finding.chi2_after = claim.chi2_after;
    auto weight = probabilities(claim.rivals, seed + findings.size());
    // What stands first although another predicts better stands there because we believe that
    // simple physics, and physics that has a name, is more probable before any data: it is given
    // half of what those got that it was preferred to.
    for (std::size_t k = 1; k < weight.size(); ++k) {
      if (weight[k] <= weight.front()) continue;
      const double half = 0.5 * weight[k];
      weight[k] -= half;
      weight.front() += half;
    }
    finding.probability = weight.front();
    for (std::size_t k = 1; k < weight.size(); ++k) {
      if (weight[k] < 0.005) continue;
      finding.alternatives.push_back({claim.rivals[k].suspect, weight[k]});
    }
    const auto own = by_card_of(named);
    const Experiment& first = search.held().experiments.front();
    if (const auto& episode = finding.effect->card().episode) {
      const double last_s = first.period_s * static_cast<double>(first.samples);
      finding.when_s = {first.start_s + std::clamp(own[episode->begin_s], 0.0, last_s),
                        first.start_s + std::clamp(own[episode->end_s], 0.0, last_s)};
    }
    finding.shape = shape_of(*finding.effect, own, first);
    finding.portrait = portrait_with_bands(named, result.fitted, inflation, first);
    if (finding.probability < sure && !finding.alternatives.empty()) {
      finding.separating_experiment =
          experiment_between(claim.rivals, weight, first, horizon_s, seed, search.held().threads);
    }
    findings.push_back(std::move(finding));
  }
  return findings;
}

// The 95 % interval of an unknown, where its fit went to its end; its value alone otherwise.
std::pair<double, double> interval_of(const Candidate& candidate, std::size_t u) {
  const Fit& fitted = candidate.fitted;
  const auto i = static_cast<Eigen::Index>(u);
  double half = 0.0;
  if (i < fitted.covariance.rows()) {
    const double inflation = std::sqrt(std::max(1.0, fitted.chi2_per_sample()));
    half = 1.96 * inflation * std::sqrt(std::max(0.0, fitted.covariance(i, i)));
  }
  return std::minmax(candidate.hypothesis->value(u, fitted.z[u] - half),
                     candidate.hypothesis->value(u, fitted.z[u] + half));
}

Evidence evidence_of(const Search& search, const std::vector<Experiment>& experiments,
                     int threads) {
  Task whole = task_for(experiments, false, threads);
  const Task held = task_for(experiments, true, threads);
  whole.windows.insert(whole.windows.end(), held.windows.begin(), held.windows.end());
  FitOptions few;
  few.iterations = 8;
  const Candidate& null = search.null();
  const Candidate& result = search.result();
  const Fit before = fit_states(whole, *null.hypothesis, null.fitted.z, few);
  const Fit after = fit_states(whole, *result.hypothesis, result.fitted.z, few);
  return evidence_of(whole, {&*null.hypothesis, before.z, &before.state},
                     {&*result.hypothesis, after.z, &after.state});
}

// Where the declared model fails, in units of the noise, whatever the weights of its fit were.
Location location_of(const Search& search, const std::vector<Experiment>& experiments,
                     std::uint64_t seed) {
  Task measured = search.null_train();
  measured.sigma = noise_sigma(experiments);
  const Candidate& null = search.null();
  Fit residuals = null.fitted;
  for (std::size_t w = 0; w < measured.windows.size(); ++w) {
    const WindowRef ref = measured.windows[w];
    const Experiment& e = experiments[ref.experiment];
    const Window& window = e.windows[ref.window];
    const auto readings =
        predict(e, window, window.end, *null.hypothesis, null.fitted.z, null.fitted.state[w]);
    residuals.chi2[w] = 0.0;
    for (std::size_t k = window.begin; k < window.end; ++k) {
      for (std::size_t c = 0; c < predicted_channels; ++c) {
        if (((e.valid[k] >> c) & 1U) == 0) continue;
        const double r = (readings[k - window.begin][c] - e.reading[k][c]) / measured.sigma[c];
        residuals.chi2[w] += std::min(r * r, 1.0e12);
      }
    }
  }
  const auto relation = search.claims().empty()
                            ? search.suspected().value_or(physics::Relation::force_balance)
                            : search.claims().front().suspect.effect->card().relation;
  Location location = locate(measured, *null.hypothesis, residuals, relation, search.limit());
  location.regions = regions_of(measured, *null.hypothesis, residuals, seed);
  if (!search.claims().empty() && search.claims().front().suspect.place.channel) {
    location.channel = search.claims().front().suspect.place.channel;
  }
  return location;
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

Diagnosis diagnose(const std::vector<protocol::Recording>& recordings, const Model& model,
                   const Options& options) {
  Diagnosis out;
  std::vector<Experiment> experiments;
  std::vector<Experiment> rough;
  for (const protocol::Recording& recording : recordings) {
    experiments.push_back(make_experiment(recording, model));
    rough.push_back(make_experiment(recording, model, Steps::rough));
    out.integrity.push_back(integrity_of(recording, model));
  }
  out.horizon_s = options.horizon_s.value_or(default_horizon_s(model, experiments.front()));
  for (Experiment& e : rough) cut_windows(e, model, out.horizon_s);
  for (Experiment& e : experiments) {
    cut_windows(e, model, out.horizon_s);
    for (const Window& window : e.windows)
      ++(window.held_out ? out.heldout_windows : out.fitted_windows);
  }
  if (out.fitted_windows < 2 || out.heldout_windows < 2) {
    throw InputError(Problem{recordings.front().source, 0, 0,
                             "is too short: it gives " + std::to_string(out.fitted_windows) +
                                 " windows of " + std::to_string(out.horizon_s) + " s to fit and " +
                                 std::to_string(out.heldout_windows) +
                                 " to hold out; at least 2 of each are needed"});
  }

  Search search(experiments, rough, options);
  search.run(model);
  if (options.progress) options.progress("scoring the result", 0.92);
  const Candidate& null = search.null();
  const Candidate& result = search.result();
  out.baseline = score(search.held(), *null.hypothesis, null.fitted.z);
  if (!search.claims().empty())
    out.augmented = score(search.held(), *result.hypothesis, result.fitted.z);
  out.findings = findings_of(search, out.horizon_s, options.seed);
  out.trials = search.trials();

  const double excess_before = null.held_out.chi2 - 1.0;
  const double excess_after = result.held_out.chi2 - 1.0;
  const bool explained = (result.held_out.chi2 <= search.limit() && !search.is_strained()) ||
                         (!out.findings.empty() && excess_after <= 0.1 * excess_before);
  out.verdict = !explained
                    ? Verdict::unexplained
                    : (out.findings.empty() ? Verdict::consistent : Verdict::missing_physics);
  if (out.verdict != Verdict::consistent) {
    out.location = location_of(search, experiments, options.seed);
    if (!out.findings.empty() && out.findings.front().when_s) {
      out.location->when_s = {*out.findings.front().when_s};
    }
  }

  if (options.progress) options.progress("what else would have been seen", 0.95);
  out.detection = search.detection();
  if (options.evidence) out.evidence = evidence_of(search, experiments, options.threads);
  out.model = result.hypothesis->model_at(result.fitted.z);
  out.baseline_model = null.hypothesis->model_at(null.fitted.z);
  const auto& unknowns = result.hypothesis->unknowns();
  const auto& paths = result.hypothesis->rig().parameter_paths();
  physics::Model stated = model;
  const auto stated_parameters = physics::parameters_of(stated);
  for (std::size_t u = 0; u < unknowns.size(); ++u) {
    if (!unknowns[u].of_model) continue;
    Calibration each{paths[unknowns[u].parameter], result.hypothesis->value(u, result.fitted.z[u])};
    for (const auto& named : stated_parameters) {
      if (named.path == each.path && named.parameter->sigma > 0.0) {
        each.sigmas_off = (each.value - named.parameter->value) / named.parameter->sigma;
        each.declared = named.parameter->value;
        each.sigma = named.parameter->sigma;
      }
    }
    std::tie(each.low, each.high) = interval_of(result, u);
    out.calibrated.push_back(each);
  }
  const Experiment& first = experiments.front();
  for (const Channel channel : all_channels) {
    const std::size_t c = index_of(channel);
    if (!(first.noise_std[c] > 0.0)) continue;
    out.noise_std.emplace_back(channel, first.noise_std[c]);
    if (!first.noise_declared[c]) out.noise_estimated.push_back(channel);
  }
  if (options.progress) options.progress("done", 1.0);
  return out;
}

}  // namespace stickslip::diagnosis
