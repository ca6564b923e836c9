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

constexpr double longest_run_s = 12.0;
constexpr std::size_t windows_compared = 12;
constexpr double worth_a_run = 0.1;  // chi-squared per sample
constexpr double much_more = 3.0;    // than a run like the recording tells

struct Run {
  std::string_view words;
  Rerun how;
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
    Run{"the mass let go from its largest deflection, the drive off",
        {.amplitude = 0.0, .release = 1.0}},
};

bool can_be_made(const Run& run, const physics::Model& model) {
  const bool imposed = model.oscillator.excitation == physics::Excitation::imposed;
  if (run.how.release > 0.0 && imposed) return false;
  if (run.load == 1.0) return true;
  return model.normal_load && model.normal_load->law != physics::NormalLoadLaw::measured;
}

// Chi-squared per sample that `account` is left with beyond the noise in a run of `truth`.
double excess_of(const Run& run, const Experiment& recorded, const Account& truth,
                 const Account& account, double horizon_s, std::uint64_t seed) {
  Rerun how = run.how;
  how.longest_s = longest_run_s;
  const protocol::Recording recording =
      rerun(recorded, truth.hypothesis->model_at(truth.z), how, seed);
  std::vector<Experiment> experiments{make_experiment(
      recording, with_noise_of(account.hypothesis->model(), recorded), Steps::rough)};
  cut_windows(experiments.front(), account.hypothesis->model(), horizon_s);
  const std::size_t all = experiments.front().windows.size();
  const std::size_t count = std::min(all, windows_compared);
  Task task;
  task.experiments = experiments;
  task.sigma = noise_sigma(experiments);
  for (std::size_t i = 0; i < count; ++i) task.windows.push_back({0, i * all / count});
  const std::vector<double> z(account.z.begin(), account.z.end());
  FitOptions options;
  options.iterations = 6;
  options.tolerance = 1.0e-2;
  options.covariance = false;
  std::vector<WindowState> states = guessed_states(task, *account.hypothesis);
  task.base_response = base_response_of(task, *account.hypothesis, z, states);
  const Fit fitted = fit(task, *account.hypothesis, z, std::move(states), options);
  return fitted.chi2_per_sample() - 1.0;
}

}  // namespace

std::optional<Separation> separation_of(const Experiment& recorded, const Account& one,
                                        const Account& other, double horizon_s, std::uint64_t seed,
                                        int threads) {
  // The run as it was comes first, so that the others can be held against it.
  std::vector<std::array<double, 2>> excess(menu.size(), {0.0, 0.0});
  parallel::for_each(2 * menu.size(), threads, [&](std::size_t job) {
    const Run& run = menu[job / 2];
    if (!can_be_made(run, one.hypothesis->model())) return;
    const Hypothesis a = one.hypothesis->loaded(run.load);
    const Hypothesis b = other.hypothesis->loaded(run.load);
    const Account first{&a, one.z};
    const Account second{&b, other.z};
    try {
      excess[job / 2][job % 2] = job % 2 == 0
                                     ? excess_of(run, recorded, first, second, horizon_s, seed)
                                     : excess_of(run, recorded, second, first, horizon_s, seed);
    } catch (const InputError&) {
      // A run that leaves nothing to compare tells nothing.
    }
  });
  const auto worse = [&](std::size_t run) {
    const double least = std::min(excess[run][0], excess[run][1]);
    return std::isfinite(least) ? std::max(least, 0.0) : 0.0;
  };
  std::size_t best = 0;
  for (std::size_t run = 1; run < menu.size(); ++run) {
    if (worse(run) > worse(best)) best = run;
  }
  if (worse(best) < std::max(worth_a_run, much_more * worse(0))) return std::nullopt;
  return Separation{std::string(menu[best].words), worse(best), worse(0)};
}

std::string sentence_of(const Separation& separation) {
  using physics::number_text;
  return separation.run + ": whichever is wrong would then miss by a chi-squared of " +
         number_text(separation.chi2_beyond) +
         " per sample beyond the noise (in another run like "
         "this one by " +
         number_text(separation.chi2_now) + ")";
}

}  // namespace stickslip::diagnosis
