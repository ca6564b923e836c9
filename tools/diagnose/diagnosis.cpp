#include "tools/diagnose/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "physics/effects/catalogue.h"
#include "physics/problem.h"
#include "tools/diagnose/locate.h"

namespace stickslip::diagnosis {

namespace {

using physics::Effect;
using physics::Model;

// Held-out chi-squared per sample up to which a recording counts as explained: where the noise is
// declared, and where it had to be guessed from the recording itself.
constexpr double explained_declared = 1.3;
constexpr double explained_estimated = 3.0;
// A term is claimed when its held-out gain is this many standard errors (over windows) above 0, ...
constexpr double claim_z = 3.3;
// ... and it takes at least this share of what chi-squared has above 1 (or of 1, where it has
// less). Where a good deal stays unexplained, a small share is no evidence: any term can soak up a
// little of what another physics left.
constexpr double claim_share_explained = 0.05;
constexpr double claim_share_unexplained = 0.3;
constexpr std::size_t most_findings = 3;
constexpr std::size_t finalists = 5;

double explained_limit(const std::vector<Experiment>& experiments) {
  for (const Experiment& e : experiments) {
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (((e.compared >> c) & 1U) != 0 && !e.noise_declared[c]) return explained_estimated;
    }
  }
  return explained_declared;
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

physics::Scales scales_of(const std::vector<Experiment>& experiments, const Hypothesis& hypothesis,
                          std::span<const double> z) {
  const Experiment& e = experiments.front();
  const auto parameters = hypothesis.parameters(z);
  const auto n = hypothesis.rig().numbers<double>(parameters);
  physics::Scales scales;
  scales.displacement_m = std::max(e.largest.displacement_m, 1.0e-12);
  double square = 0.0;
  double drive = 0.0;
  for (const StateGuess& guess : e.guess) square += guess.velocity_m_s * guess.velocity_m_s;
  for (const physics::Input& input : e.input) {
    drive = std::max(
        {drive, std::abs(input.drive_force_n), n.c.mass * std::abs(input.base_acceleration_m_s2)});
  }
  scales.velocity_m_s = std::max(std::sqrt(square / static_cast<double>(e.samples)), 1.0e-9);
  scales.stiffness_n_m = n.c.stiffness;
  scales.force_n =
      std::max({drive, n.c.stiffness * scales.displacement_m, e.largest.friction_n, 1.0e-12});
  const auto& structure = hypothesis.rig().structure();
  scales.friction_n = structure.friction ? n.c.mu * (structure.loaded ? e.mean_load_n : 1.0) : 0.0;
  scales.mean_load_n = e.mean_load_n;
  scales.duration_s = e.period_s * static_cast<double>(e.samples);
  scales.sample_period_s = e.period_s;
  return scales;
}

// The windows' states carried over to a hypothesis that may have states that the other lacks.
std::vector<WindowState> carried(const std::vector<WindowState>& from, const Task& task,
                                 const Hypothesis& old_hypothesis, const Hypothesis& hypothesis) {
  std::vector<WindowState> states = guessed_states(task, hypothesis);
  const bool same_contact =
      old_hypothesis.rig().structure().kinetics == hypothesis.rig().structure().kinetics;
  for (std::size_t w = 0; w < states.size(); ++w) {
    for (int i = 0; i < physics::max_rig_states; ++i) {
      if (!old_hypothesis.rig().has_state(i)) continue;
      if (i == physics::state::contact && !same_contact) continue;
      states[w][static_cast<std::size_t>(i)] = from[w][static_cast<std::size_t>(i)];
    }
  }
  return states;
}

// How badly a window is predicted, so that neither one wild window nor a wrong noise level decides:
// half the log-likelihood of a residual whose scale is not known better than the noise.
// Every free state of a window counts one against the hypothesis that has it.
double window_loss(double chi2, int count, int states) {
  return 0.5 * count * std::log1p(chi2 / std::max(1, count)) + states;
}

struct HeldOut {
  std::vector<double> loss;  // by window
  double chi2 = 0.0;
};

HeldOut held_out_of(const Task& task, const Hypothesis& hypothesis, std::span<const double> z) {
  FitOptions states_only;
  states_only.parameters_free = false;
  states_only.iterations = 12;
  const Fit fitted =
      fit(task, hypothesis, {z.begin(), z.end()}, guessed_states(task, hypothesis), states_only);
  HeldOut out;
  for (std::size_t w = 0; w < fitted.chi2.size(); ++w) {
    out.loss.push_back(window_loss(fitted.chi2[w], fitted.count[w], fitted.states_per_window));
  }
  out.chi2 = fitted.chi2_per_sample();
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
    auto& values = mean_square[c];
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    task.sigma[c] = std::max(noise_sigma(task.experiments)[c], std::sqrt(*middle));
  }
}

struct Candidate {
  const Effect* effect = nullptr;
  std::optional<Hypothesis> hypothesis;
  Fit fitted;
  HeldOut held_out;
  double z = 0.0;
};

Fit fit_in_stages(const Task& task, const Hypothesis& hypothesis, const std::vector<double>& z,
                  const std::vector<WindowState>& states, int iterations) {
  // First the beginning of each window, where even a wrong model has not yet lost the motion.
  Task beginning = task;
  beginning.share = 0.35;
  FitOptions few;
  few.iterations = 4;
  few.tolerance = 1.0e-3;
  const Fit first = fit(beginning, hypothesis, z, states, few);
  FitOptions all;
  all.iterations = iterations;
  return fit(task, hypothesis, first.z, first.state, all);
}

// One for a parameter, two for a hidden state that every window starts free.
double complexity(const Candidate& candidate) {
  return 2.0 * candidate.fitted.states_per_window +
         static_cast<double>(candidate.hypothesis->unknowns().size());
}

bool are_rivals(const Effect& a, const Effect& b) {
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
      total[k] = 0.0;
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

Finding finding_of(const Candidate& candidate, const Fit& fitted, double inflation) {
  Finding finding;
  finding.effect = candidate.effect;
  const Hypothesis& hypothesis = *candidate.hypothesis;
  const auto values = hypothesis.parameters(fitted.z);
  const std::string prefix = "physics." + std::string(candidate.effect->card().id) + ".";
  const auto& paths = hypothesis.rig().parameter_paths();
  std::vector<double> by_card;
  for (const physics::ParameterCard& card : candidate.effect->card().parameters) {
    const auto at = static_cast<std::size_t>(
        std::find(paths.begin(), paths.end(), prefix + std::string(card.name)) - paths.begin());
    by_card.push_back(values[at]);
    for (std::size_t u = 0; u < hypothesis.unknowns().size(); ++u) {
      if (hypothesis.unknowns()[u].parameter != at) continue;
      const auto i = static_cast<Eigen::Index>(u);
      const double half = 1.96 * inflation * std::sqrt(std::max(0.0, fitted.covariance(i, i)));
      finding.parameters.push_back({std::string(card.name), values[at],
                                    hypothesis.value(u, fitted.z[u] - half),
                                    hypothesis.value(u, fitted.z[u] + half)});
    }
  }
  finding.statement = candidate.effect->statement(by_card);
  return finding;
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
  const auto progress = [&](const std::string& what, double done) {
    if (options.progress) options.progress(what, done);
  };
  Diagnosis out;
  std::vector<Experiment> experiments;
  for (const protocol::Recording& recording : recordings) {
    experiments.push_back(make_experiment(recording, model));
  }
  out.horizon_s = options.horizon_s.value_or(default_horizon_s(model, experiments.front()));
  for (Experiment& e : experiments) cut_windows(e, model, out.horizon_s);
  Task train = task_for(experiments, false, options.threads);
  const Task held = task_for(experiments, true, options.threads);
  if (train.windows.size() < 2 || held.windows.empty()) {
    throw InputError(Problem{recordings.front().source, 0, 0,
                             "is too short: it gives " + std::to_string(train.windows.size()) +
                                 " windows of " + std::to_string(out.horizon_s) + " s to fit and " +
                                 std::to_string(held.windows.size()) +
                                 " to hold out; at least 2 and 1 are needed"});
  }
  out.fitted_windows = train.windows.size();
  out.heldout_windows = held.windows.size();
  const double limit = explained_limit(experiments);

  // The declared model, calibrated within its priors.
  progress("calibrating the declared model", 0.0);
  Candidate current;
  current.hypothesis.emplace(model);
  const std::vector<double> origin(current.hypothesis->unknowns().size(), 0.0);
  current.fitted = fit_in_stages(train, *current.hypothesis, origin,
                                 guessed_states(train, *current.hypothesis), 14);
  reweigh(train, *current.hypothesis, current.fitted);
  FitOptions again;
  current.fitted = fit(train, *current.hypothesis, current.fitted.z, current.fitted.state, again);
  current.held_out = held_out_of(held, *current.hypothesis, current.fitted.z);
  const Candidate null = current;
  const Task null_train = train;

  std::optional<physics::Relation> suspected;
  std::vector<Candidate> found;
  std::vector<std::vector<Candidate>> rivals_of_found;
  for (std::size_t stage = 0; stage <= most_findings; ++stage) {
    const double stage_begin = 0.1 + 0.8 * static_cast<double>(stage) / (most_findings + 1);
    const double stage_span = 0.8 / (most_findings + 1);
    std::vector<Candidate> candidates;
    const auto catalogue = physics::catalogue();
    for (std::size_t i = 0; i < catalogue.size(); ++i) {
      const Effect& effect = *catalogue[i];
      if (!physics::can_be_missing(effect, current.hypothesis->model())) continue;
      progress("trying " + std::string(effect.card().id),
               stage_begin + stage_span * 0.7 * static_cast<double>(i) /
                                 static_cast<double>(catalogue.size()));
      const auto scales = scales_of(experiments, *current.hypothesis, current.fitted.z);
      Candidate best;
      best.effect = &effect;
      for (const auto& start : effect.starts(scales)) {
        const Hypothesis hypothesis = current.hypothesis->with(effect, start, effect.fixed(scales));
        for (const std::vector<double>& z : starting_points(current, hypothesis)) {
          Fit fitted = fit_in_stages(
              train, hypothesis, z,
              carried(current.fitted.state, train, *current.hypothesis, hypothesis), 6);
          if (!best.hypothesis || fitted.cost < best.fitted.cost) {
            best.hypothesis.emplace(hypothesis);
            best.fitted = std::move(fitted);
          }
        }
      }
      if (best.hypothesis) candidates.push_back(std::move(best));
    }
    if (candidates.empty()) break;
    std::sort(candidates.begin(), candidates.end(),
              [](const Candidate& a, const Candidate& b) { return a.fitted.cost < b.fitted.cost; });
    if (candidates.size() > finalists)
      candidates.erase(candidates.begin() + finalists, candidates.end());
    progress("scoring on held-out data", stage_begin + stage_span * 0.75);
    for (Candidate& candidate : candidates) {
      FitOptions to_the_end;
      Task own = train;
      reweigh(own, *candidate.hypothesis, candidate.fitted);
      candidate.fitted =
          fit(own, *candidate.hypothesis, candidate.fitted.z, candidate.fitted.state, to_the_end);
      candidate.held_out = held_out_of(held, *candidate.hypothesis, candidate.fitted.z);
      candidate.z = gain_z(current.held_out, candidate.held_out);
      out.trials.push_back({std::string(candidate.effect->card().id), static_cast<int>(stage),
                            candidate.held_out.chi2, candidate.z});
    }
    const auto loss = [](const Candidate& c) {
      double sum = 0.0;
      for (const double each : c.held_out.loss) sum += each;
      return sum;
    };
    std::sort(candidates.begin(), candidates.end(),
              [&](const Candidate& a, const Candidate& b) { return loss(a) < loss(b); });
    // A law with a parameter or a hidden state more can always imitate its relative that lacks it:
    // of declared rivals the simpler stands as long as the other is not clearly better.
    const Candidate& best = candidates.front();
    std::size_t chosen = 0;
    for (std::size_t k = 1; k < candidates.size(); ++k) {
      if (are_rivals(*best.effect, *candidates[k].effect) &&
          complexity(candidates[k]) < complexity(candidates[chosen]) &&
          gain_z(candidates[k].held_out, best.held_out) < claim_z &&
          loss(candidates[k]) - loss(best) < 0.15 * (loss(current) - loss(best))) {
        chosen = k;
      }
    }
    std::rotate(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(chosen),
                candidates.begin() + static_cast<std::ptrdiff_t>(chosen) + 1);
    const Candidate& winner = candidates.front();
    if (!suspected) suspected = winner.effect->card().relation;
    const double excess = std::max(current.held_out.chi2 - 1.0, 1.0);
    const double share =
        winner.held_out.chi2 <= limit ? claim_share_explained : claim_share_unexplained;
    const bool claimed =
        winner.z > claim_z && current.held_out.chi2 - winner.held_out.chi2 > share * excess;
    if (!claimed || found.size() == most_findings) break;
    rivals_of_found.push_back(candidates);
    current = winner;
    found.push_back(current);
    reweigh(train, *current.hypothesis, current.fitted);
    FitOptions settle;
    current.fitted =
        fit(train, *current.hypothesis, current.fitted.z, current.fitted.state, settle);
    current.held_out = held_out_of(held, *current.hypothesis, current.fitted.z);
  }

  progress("scoring the result", 0.92);
  out.baseline = score(held, *null.hypothesis, null.fitted.z);
  if (!found.empty()) out.augmented = score(held, *current.hypothesis, current.fitted.z);
  const double inflation = std::sqrt(std::max(1.0, current.fitted.chi2_per_sample()));
  double chi2_before = null.held_out.chi2;
  for (std::size_t i = 0; i < found.size(); ++i) {
    Candidate last = current;
    last.effect = found[i].effect;
    Finding finding = finding_of(last, current.fitted, inflation);
    finding.chi2_before = chi2_before;
    finding.chi2_after = found[i].held_out.chi2;
    chi2_before = found[i].held_out.chi2;
    const auto weight = probabilities(rivals_of_found[i], options.seed + i);
    finding.probability = weight.front();
    for (std::size_t k = 1; k < weight.size(); ++k) {
      if (weight[k] < 0.005) continue;
      finding.alternatives.push_back(
          {std::string(rivals_of_found[i][k].effect->card().id), weight[k]});
    }
    if (finding.probability < 0.95 && !finding.alternatives.empty()) {
      finding.separating_experiment = std::string(finding.effect->card().experiment);
    }
    out.findings.push_back(std::move(finding));
  }

  const double last_chi2 = current.held_out.chi2;
  const double first_excess = null.held_out.chi2 - 1.0;
  const bool explained =
      last_chi2 <= limit || (!found.empty() && last_chi2 - 1.0 <= 0.1 * first_excess);
  if (found.empty()) {
    out.verdict = explained ? Verdict::consistent : Verdict::unexplained;
  } else {
    out.verdict = explained ? Verdict::missing_physics : Verdict::unexplained;
  }
  if (out.verdict != Verdict::consistent) {
    progress("locating the mismatch", 0.97);
    const auto relation = !found.empty() ? found.front().effect->card().relation
                                         : suspected.value_or(physics::Relation::force_balance);
    Task measured = null_train;
    measured.sigma = noise_sigma(experiments);
    Fit residuals = null.fitted;
    // In units of the noise, whatever the weights of the fit were.
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
    out.location = locate(measured, *null.hypothesis, residuals, relation, limit);
  }

  out.model = current.hypothesis->model_at(current.fitted.z);
  const auto& unknowns = current.hypothesis->unknowns();
  const auto& paths = current.hypothesis->rig().parameter_paths();
  for (std::size_t u = 0; u < unknowns.size(); ++u) {
    if (unknowns[u].of_model) {
      out.calibrated.emplace_back(paths[unknowns[u].parameter],
                                  current.hypothesis->value(u, current.fitted.z[u]));
    }
  }
  for (const Channel channel : all_channels) {
    const Experiment& e = experiments.front();
    const std::size_t c = index_of(channel);
    if (!(e.noise_std[c] > 0.0)) continue;
    out.noise_std.emplace_back(channel, e.noise_std[c]);
    if (!e.noise_declared[c]) out.noise_estimated.push_back(channel);
  }
  progress("done", 1.0);
  return out;
}

}  // namespace stickslip::diagnosis
