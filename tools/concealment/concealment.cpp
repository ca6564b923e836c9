// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/concealment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "physics/failure.h"
#include "tools/concealment/bench_drawing.h"
#include "tools/concealment/hidden_effect.h"
#include "tools/concealment/imperfect_instruments.h"
#include "tools/concealment/noiseless_run.h"
#include "tools/concealment/recorder.h"
#include "tools/concealment/rounding.h"
#include "tools/concealment/sample_times.h"

namespace stickslip::concealment {

namespace {

// Limits of the signal-to-noise ratio of an effect; the defaults make it easily visible.
struct Visibility {
  double least = 4.0;
  double most = 320.0;
  double too_much = 80.0;  ///< reduced, if that is possible
  double least_after_calibration = 1.2;
  double target_low = 5.0;
  double target_high = 35.0;
  bool on_request = false;
  int max_strengths = 6;  ///< simulations with different strengths of the effects
};
Visibility visibility_of(const CaseRequest& request) {
  if (!request.snr) return {};
  const auto [low, high] = *request.snr;
  return {low, high, high, 0.3 * low, low, high, true, 10};
}

std::map<std::string, double> true_parameters(const Bench& bench) {
  const physics::Model& m = bench.declared;
  const ReferenceRig& rig = bench.rig;
  std::map<std::string, double> all;
  if (rig.excitation != physics::Excitation::imposed) {
    all["oscillator.mass_kg"] = rig.mass_kg;
    all["oscillator.stiffness_n_m"] = rig.stiffness_n_m;
    all["oscillator.damping_n_s_m"] = rig.damping_n_s_m;
    if (m.oscillator.two_well) {
      all["oscillator.two_well.linear_n_m"] = rig.well_linear_n_m;
      all["oscillator.two_well.cubic_n_m3"] = rig.well_cubic_n_m3;
    }
  }
  if (m.normal_load) all["normal_load.load_n"] = rig.load_n;
  if (rig.friction) all["friction.mu"] = rig.mu;
  if (rig.cell) all["load_cell.natural_frequency_hz"] = rig.cell_frequency_hz;
  return all;
}

// ---- A bench with effects of adjustable strength

struct Draft {
  Plan plan;
  Bench bench;  ///< without the effects
  Sizes sizes;
  bool noise_declared = true;
  std::optional<Imperfections> imperfections;
  SampleTimes times;
  SampleTimes validation_times;
  std::vector<Tone> validation_drive;
  std::vector<RandomSource> effect_random;
  std::vector<double> strength;
  std::vector<double> target_snr;
  Visibility visibility;
};

// Noise of 0.2 to 2 % and 16 bits over five times the range.
void draw_noise(Draft& draft, RandomSource& random) {
  for (std::size_t c = 0; c < channel_count; ++c) {
    Instrument& instrument = draft.bench.rig.instrument[c];
    const double share = random.log_uniform(0.002, 0.02);
    if (!instrument.recorded) continue;
    const double spread = std::max(draft.sizes.spread[c], 0.2 * draft.sizes.largest[c]);
    instrument.noise_std = rounded(share * spread, 2);
    instrument.resolution = std::min(round_step(draft.sizes.largest[c] * 5.0 / 65536.0),
                                     round_step(instrument.noise_std));
    if (draft.noise_declared) draft.bench.declared.sensors[c].noise_std = instrument.noise_std;
  }
}

struct HiddenBench {
  Bench bench;
  std::vector<TrueEffect> effects;
};
// The bench with all effects but the one of index `without`.
HiddenBench with_effects(const Draft& draft, std::size_t without) {
  HiddenBench out{draft.bench, {}};
  for (std::size_t i = 0; i < draft.plan.effects.size(); ++i) {
    if (i == without) continue;
    out.effects.push_back(hide(*draft.plan.effects[i], draft.strength[i], draft.sizes, out.bench,
                               draft.effect_random[i]));
  }
  return out;
}

// False if the bench cannot have these nuisances.
bool draw_instruments(Draft& draft, const std::vector<Nuisance>& requested, RandomSource& random) {
  const std::vector<Nuisance> nuisances =
      requested.empty() ? draw_nuisances(draft.bench, random) : requested;
  for (const Nuisance each : nuisances) {
    if (!is_applicable(each, draft.bench)) return false;
  }
  std::set<Channel> taken;
  for (const TrueEffect& effect : with_effects(draft, draft.plan.effects.size()).effects) {
    if (effect.channel) taken.insert(*effect.channel);
  }
  draft.imperfections = make_imperfect(draft.bench, nuisances, draft.sizes, taken, random);
  draft.noise_declared =
      draft.noise_declared || draft.imperfections->drawn.contains(name_of(Nuisance::half_noise));
  return true;
}

void draw_times(Draft& draft, RandomSource& random) {
  const Clock clock =
      draft.imperfections ? draft.imperfections->clock : Clock{draft.bench.sample_rate_hz};
  draft.times = sample_times(clock, draft.sizes.duration_s, random);
  draft.validation_times =
      sample_times(clock, std::round(draft.sizes.duration_s * 2.0 / 3.0), random);
}

// Empty if the bench without effects is not plausible, or cannot have what is requested.
std::optional<Draft> draw_draft(const CaseRequest& request, std::uint64_t effect_seed,
                                RandomSource& random) {
  Draft draft;
  std::optional<Plan> plan = draw_plan(request, random);
  if (!plan) return std::nullopt;
  draft.plan = *std::move(plan);
  draft.visibility = visibility_of(request);
  draft.bench = draw_bench(draft.plan.bench, draft.plan.requirements, random);
  draft.noise_declared = random.chance(0.5);
  const double duration_s = std::round(request.duration_s * random.uniform(1.0, 1.3));
  const SampleTimes first = sample_times({draft.bench.sample_rate_hz}, 8.0, random);
  const NoiselessRun plain = simulate(draft.bench.rig, first.sampled_s, false);
  if (!is_plausible(plain, draft.bench.rig)) return std::nullopt;
  measure(plain, draft.sizes);
  draft.sizes.duration_s = duration_s;
  draw_noise(draft, random);
  draft.validation_drive = draw_drive(draft.plan.bench, draft.bench.rig, random);
  for (std::size_t i = 0; i < draft.plan.effects.size(); ++i) {
    draft.effect_random.emplace_back(effect_seed + i);
    draft.strength.push_back(1.0);
    draft.target_snr.push_back(
        random.log_uniform(draft.visibility.target_low, draft.visibility.target_high));
  }
  RandomSource instruments(effect_seed ^ 0x5851f42d4c957f2dU);
  if (request.imperfect_instruments && !draw_instruments(draft, request.nuisances, instruments)) {
    return std::nullopt;
  }
  draw_times(draft, instruments);
  return draft;
}

// Change of the readings by one prior standard deviation of each uncertain parameter, in columns.
Eigen::MatrixXd prior_sensitivity(const Draft& draft, const ReferenceRig& rig,
                                  const NoiselessRun& run) {
  Eigen::MatrixXd columns;
  const auto& shifts = draft.bench.prior_shifts;
  for (std::size_t s = 0; s < shifts.size() && !draft.plan.effects.empty(); ++s) {
    ReferenceRig shifted = rig;
    shifts[s](shifted);
    const Eigen::VectorXd column = difference(run, rig, shifted, draft.bench.sample_rate_hz);
    if (s == 0) columns.resize(column.size(), static_cast<Eigen::Index>(shifts.size()));
    columns.col(static_cast<Eigen::Index>(s)) = column;
  }
  return columns;
}

double snr_after_calibration(const Eigen::VectorXd& change, const Eigen::MatrixXd& shifts) {
  if (shifts.cols() == 0) return root_mean_square(change);
  const auto n = shifts.cols();
  const Eigen::MatrixXd normal = shifts.transpose() * shifts + Eigen::MatrixXd::Identity(n, n);
  const Eigen::VectorXd absorbed = normal.ldlt().solve(shifts.transpose() * change);
  return root_mean_square(change - shifts * absorbed);
}

// An error that a sound instrument may have is no missing physics.
bool is_a_finding(const TrueEffect& effect, const Draft& draft) {
  return !draft.imperfections ||
         is_beyond_tolerance(effect, draft.sizes, draft.bench.sample_rate_hz);
}

enum class Assessment { sufficient, adjusted, insufficient };

// Fills in the signal-to-noise ratios of the effects and, unless it is the last attempt, moves the
// strengths towards their targets.
Assessment assess(Draft& draft, HiddenBench& hidden, const NoiselessRun& run, bool last_attempt) {
  const ReferenceRig& rig = hidden.bench.rig;
  const Eigen::MatrixXd shifts = prior_sensitivity(draft, rig, run);
  const Visibility& limits = draft.visibility;
  bool visible = true;
  bool again = false;
  for (std::size_t i = 0; i < draft.plan.effects.size(); ++i) {
    const ReferenceRig without = with_effects(draft, i).bench.rig;
    const Eigen::VectorXd change = difference(run, rig, without, draft.bench.sample_rate_hz);
    TrueEffect& effect = hidden.effects[i];
    effect.snr = root_mean_square(change);
    effect.snr_after_calibration = snr_after_calibration(change, shifts);
    const bool subtle = effect.snr_after_calibration < limits.least_after_calibration ||
                        !is_a_finding(effect, draft);
    const bool within = effect.snr >= limits.least && effect.snr <= limits.most;
    const bool seen = within && !subtle;
    visible = visible && seen;
    // Of the requested size, but calibration would hide it: no other strength helps.
    if (limits.on_request && within && subtle) return Assessment::insufficient;
    const double target = draft.target_snr[i];
    const bool off = effect.snr > limits.too_much || effect.snr < 0.8 * target || !seen;
    if (!draft.plan.effects[i]->scalable || !off || last_attempt) continue;
    double factor = target / std::max(effect.snr, 0.01);
    if (subtle && !limits.on_request) factor = std::max(factor, 2.0);
    draft.strength[i] *= std::clamp(factor, 0.25, 4.0);
    again = again || !seen || effect.snr > limits.too_much;
  }
  if (again) return Assessment::adjusted;
  return visible ? Assessment::sufficient : Assessment::insufficient;
}

void apply(const Imperfections& imperfections, const Draft& draft, Case& made) {
  made.truth.nuisances = imperfections.drawn;
  made.with_instruments = with_declared_instruments(draft.bench, draft.sizes);
  leave_out(imperfections, true, made.recording, &made.states);
  leave_out(imperfections, false, made.validation, nullptr);
}

// Empty if the validation run is not plausible.
std::optional<Case> make_case(const Draft& draft, const HiddenBench& hidden,
                              const NoiselessRun& run, const std::string& name,
                              RandomSource& random) {
  Case out;
  out.declared = draft.bench.declared;
  GroundTruth& truth = out.truth;
  truth.name = name;
  truth.kind = draft.plan.kind;
  truth.world = name_of(draft.plan.bench);
  truth.verdict = draft.plan.effects.empty() ? "consistent" : "missing_physics";
  truth.duration_s = draft.sizes.duration_s;
  truth.sample_rate_hz = draft.bench.sample_rate_hz;
  truth.slip_share = rounded(run.slip_share, 3);
  truth.noise_declared = draft.noise_declared;
  truth.effects = hidden.effects;
  for (const Channel channel : all_channels) {
    const Instrument& instrument = draft.bench.rig.instrument[index_of(channel)];
    if (!instrument.recorded) continue;
    truth.noise_std[std::string(info(channel).column)] = instrument.noise_std;
  }
  truth.parameters = true_parameters(hidden.bench);
  out.recording = recorded(run, draft.times, hidden.bench.rig, name + "/recording.csv", random);
  out.states = run.truth;
  ReferenceRig validation = hidden.bench.rig;
  validation.drive = draft.validation_drive;
  const NoiselessRun other = simulate(validation, draft.validation_times.sampled_s, false);
  if (!is_plausible(other, validation)) return std::nullopt;
  out.validation =
      recorded(other, draft.validation_times, validation, name + "/validation.csv", random);
  if (draft.imperfections) apply(*draft.imperfections, draft, out);
  return out;
}

// Empty if the effects cannot be made visible on this bench; `attempt` counts the simulations.
std::optional<Case> case_of(Draft& draft, const std::string& name, int& attempt,
                            RandomSource& random) {
  const int max_strengths = draft.visibility.max_strengths;
  for (int tried = 0; tried < max_strengths; ++tried) {
    ++attempt;
    HiddenBench hidden = with_effects(draft, draft.plan.effects.size());
    const NoiselessRun run = simulate(hidden.bench.rig, draft.times.sampled_s, true);
    if (!is_plausible(run, hidden.bench.rig)) {
      for (double& each : draft.strength) each *= 0.5;
      continue;
    }
    switch (assess(draft, hidden, run, tried + 1 == max_strengths)) {
      case Assessment::sufficient:
        return make_case(draft, hidden, run, name, random);
      case Assessment::insufficient:
        return std::nullopt;
      case Assessment::adjusted:
        break;
    }
  }
  return std::nullopt;
}

}  // namespace

Case conceal(const CaseRequest& request, std::uint64_t seed, const std::string& name) {
  RandomSource random(seed);
  constexpr int max_benches = 40;
  int attempt = 0;
  for (int drawn = 0; drawn < max_benches; ++drawn) {
    const std::uint64_t effect_seed = seed + 7919 * static_cast<std::uint64_t>(drawn + 1);
    std::optional<Draft> draft = draw_draft(request, effect_seed, random);
    if (!draft) continue;
    if (std::optional<Case> made = case_of(*draft, name, attempt, random)) {
      made->truth.seed = seed;
      made->truth.attempt = attempt;
      return *std::move(made);
    }
  }
  throw Failure(name + ": none of 40 benches shows the hidden effects as requested");
}

}  // namespace stickslip::concealment
