// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/separation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <vector>

#include "diagnosis/parallel/for_each.h"
#include "diagnosis/rerun.h"
#include "diagnosis/score.h"
#include "diagnosis/shooting.h"
#include "physics/number_text.h"
#include "physics/problem.h"

namespace stickslip::diagnosis {

namespace {

struct Run {
  std::string_view name;
  Rerun variation;
  double load = 1.0;
};

constexpr std::array menu = {
    Run{"another run like this one", {}},
    Run{"the same drive, half as large", {.amplitude = 0.5}},
    Run{"the same drive, a quarter as large", {.amplitude = 0.25}},
    Run{"the same drive, twice as large", {.amplitude = 2.0}},
    Run{"the same accelerations at two thirds of the pace", {.pace = 2.0 / 3.0}},
    Run{"the same accelerations at one and a half times the pace", {.pace = 1.5}},
    Run{"the drive in bursts of 2 s with rests of 2 s", {.burst_s = 2.0}},
    Run{"the same drive under twice the normal load", {}, 2.0},
    Run{"the same drive under half the normal load", {}, 0.5},
    Run{"the mass released from its largest deflection, the drive off",
        {.amplitude = 0.0, .release = 1.0}},
};

bool can_be_made(const Run& run, const physics::Model& model) {
  const bool imposed = model.oscillator.excitation == physics::Excitation::imposed;
  if (run.variation.release > 0.0 && imposed) return false;
  if (run.load == 1.0) return true;
  return model.normal_load && model.normal_load->law != physics::NormalLoadLaw::measured;
}

// Excess chi-squared per sample (above 1) of `tested`, fitted to a run simulated by `truth`.
double excess_of(const Run& run, const Experiment& recorded, const FittedHypothesis& truth,
                 const FittedHypothesis& tested, double horizon_s, std::uint64_t seed,
                 const Effort& effort) {
  Rerun variation = run.variation;
  variation.longest_s = effort.separation_run_s;
  const protocol::Recording recording =
      rerun(recorded, truth.hypothesis->model_in(truth.z, 0), variation, seed);
  std::vector<Experiment> experiments{
      make_experiment(recording, with_noise_of(tested.hypothesis->model(), recorded))};
  cut_windows(experiments.front(), tested.hypothesis->model(), horizon_s);
  const std::size_t all = experiments.front().windows.size();
  const std::size_t count = std::min(all, effort.separation_windows);
  Task task;
  task.experiments = experiments;
  task.sigma = noise_sigma(experiments);
  task.steps = Steps::coarse;
  for (std::size_t i = 0; i < count; ++i) task.windows.push_back({0, i * all / count});
  const std::vector<double> z(tested.z.begin(), tested.z.end());
  FitOptions options;
  options.iterations = 6;
  options.tolerance = 1.0e-2;
  options.covariance = false;
  std::vector<WindowState> states = initial_states(task, *tested.hypothesis);
  const Fit fitted = fit(task, *tested.hypothesis, z, std::move(states), options);
  return fitted.chi2_per_sample() - 1.0;
}

}  // namespace

std::optional<Separation> separation_of(const Experiment& recorded, const FittedHypothesis& one,
                                        const FittedHypothesis& other, double horizon_s,
                                        std::uint64_t seed, int threads, const Criteria& criteria) {
  // The first entry repeats the recorded run, for comparison.
  std::vector<std::array<double, 2>> excess(menu.size(), {0.0, 0.0});
  parallel::for_each(2 * menu.size(), threads, [&](std::size_t job) {
    const Run& run = menu[job / 2];
    if (!can_be_made(run, one.hypothesis->model())) return;
    const Hypothesis a = one.hypothesis->with_load_factor(run.load);
    const Hypothesis b = other.hypothesis->with_load_factor(run.load);
    const FittedHypothesis first{&a, one.z};
    const FittedHypothesis second{&b, other.z};
    try {
      excess[job / 2][job % 2] =
          job % 2 == 0 ? excess_of(run, recorded, first, second, horizon_s, seed, criteria.effort)
                       : excess_of(run, recorded, second, first, horizon_s, seed, criteria.effort);
    } catch (const InputError&) {
      // A run without anything to compare does not separate.
    }
  });
  const auto separated = [&](std::size_t run) {
    const double least = std::min(excess[run][0], excess[run][1]);
    return std::isfinite(least) ? std::max(least, 0.0) : 0.0;
  };
  std::size_t best = 0;
  for (std::size_t run = 1; run < menu.size(); ++run) {
    if (separated(run) > separated(best)) best = run;
  }
  if (separated(best) <
      std::max(criteria.separating_chi2, criteria.separating_ratio * separated(0))) {
    return std::nullopt;
  }
  return Separation{std::string(menu[best].name), separated(best), separated(0)};
}

std::string sentence_of(const Separation& separation) {
  using physics::number_text;
  return separation.run + ": the wrong hypothesis would leave an excess chi-squared of " +
         number_text(separation.chi2_excess) + " per sample (in a repetition of this run " +
         number_text(separation.chi2_repeated) + ")";
}

}  // namespace stickslip::diagnosis
