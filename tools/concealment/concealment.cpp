#include "tools/concealment/concealment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <span>

#include "physics/failure.h"
#include "tools/concealment/bench_drawing.h"
#include "tools/concealment/hidden_effect.h"
#include "tools/concealment/noiseless_run.h"
#include "tools/concealment/rounding.h"

namespace stickslip::concealment {

namespace {

constexpr double min_snr = 4.0;
constexpr double min_snr_after_calibration = 1.2;
constexpr double largest_snr = 80.0;

// The largest 1, 2 or 5 times a power of ten not above `value`.
double round_step(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  const double digit = value / power;
  return power * (digit >= 5.0 ? 5.0 : (digit >= 2.0 ? 2.0 : 1.0));
}

protocol::Recording recorded(const NoiselessRun& run, const Bench& bench, const std::string& source,
                             RandomSource& random) {
  protocol::Recording recording;
  recording.source = source;
  recording.frames.reserve(run.readings.size());
  for (std::size_t k = 0; k < run.readings.size(); ++k) {
    Frame frame;
    frame.time_ns = static_cast<std::int64_t>(
        std::llround(1.0e9 * static_cast<double>(k) / bench.sample_rate_hz));
    frame.sequence = k;
    for (const Channel channel : all_channels) {
      const std::size_t c = index_of(channel);
      const Instrument& instrument = bench.rig.instrument[c];
      if (!instrument.recorded) continue;
      double value = run.readings[k][c] + instrument.noise_std * random.normal();
      // Saturation applies to the noise as well.
      if (instrument.limit > 0.0) value = std::clamp(value, -instrument.limit, instrument.limit);
      // Nine digits: the quantised value without its binary tail.
      value = rounded(std::round(value / instrument.resolution) * instrument.resolution, 9);
      frame.set(channel, value);
    }
    recording.frames.push_back(frame);
    recording.channels |= frame.valid;
  }
  return recording;
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

// ---- The effects of a case and the bench for them

struct Plan {
  std::string kind;
  std::vector<const HiddenEffect*> effects;
  BenchKind bench = BenchKind::regular;
  BenchRequirements requirements;
};

bool contains(std::span<const BenchKind> kinds, BenchKind kind) {
  return std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
}

// Effects that show in the same relation are not hidden together.
bool are_compatible(const HiddenEffect& a, const HiddenEffect& b) {
  constexpr std::array friction = {"stribeck", "dwell_strengthening", "contact_compliance",
                                   "friction_memory", "dry_friction"};
  const auto replaces_law = [&](const HiddenEffect& each) {
    return std::find(friction.begin(), friction.end(), each.id) != friction.end();
  };
  return a.id != b.id && !(replaces_law(a) && replaces_law(b)) && a.listed && b.listed &&
         a.requirements.lacks_friction == b.requirements.lacks_friction &&
         a.requirements.set_valued == b.requirements.set_valued;
}

CaseRequest::Kind draw_kind(const CaseRequest& request, RandomSource& random) {
  using Kind = CaseRequest::Kind;
  if (request.kind != Kind::any) return request.kind;
  const double u = random.uniform(0.0, 1.0);
  if (!request.ids.empty()) return Kind::single;
  return u < 0.13   ? Kind::nothing
         : u < 0.21 ? Kind::pair
         : u < 0.29 ? Kind::unlisted
                    : Kind::single;
}

std::vector<const HiddenEffect*> choices_of(const CaseRequest& request, CaseRequest::Kind kind) {
  std::vector<const HiddenEffect*> choices;
  for (const HiddenEffect& each : hidden_effects()) {
    const bool named =
        std::find(request.ids.begin(), request.ids.end(), each.id) != request.ids.end();
    if (!request.ids.empty() ? named : each.listed == (kind != CaseRequest::Kind::unlisted)) {
      choices.push_back(&each);
    }
  }
  return choices;
}

Plan plan_without_effects(RandomSource& random) {
  Plan plan;
  plan.kind = "null";
  plan.bench = all_bench_kinds[random.index(all_bench_kinds.size())];
  plan.requirements.lacks_friction = random.chance(0.5);
  plan.requirements.relaxes = random.chance(0.4);
  return plan;
}

void add_second_effect(Plan& plan, const std::vector<const HiddenEffect*>& choices,
                       RandomSource& random) {
  std::vector<const HiddenEffect*> seconds;
  for (const HiddenEffect* each : choices) {
    if (are_compatible(*plan.effects.front(), *each) && contains(each->benches, plan.bench)) {
      seconds.push_back(each);
    }
  }
  if (seconds.empty()) return;
  plan.effects.push_back(seconds[random.index(seconds.size())]);
  plan.kind = "pair";
  plan.requirements.rings = plan.requirements.rings && plan.effects.back()->requirements.rings;
}

Plan draw_plan(const CaseRequest& request, RandomSource& random) {
  const CaseRequest::Kind kind = draw_kind(request, random);
  if (kind == CaseRequest::Kind::nothing) return plan_without_effects(random);
  const std::vector<const HiddenEffect*> choices = choices_of(request, kind);
  Plan plan;
  const HiddenEffect* first = choices[random.index(choices.size())];
  plan.effects.push_back(first);
  plan.bench = first->benches[random.index(first->benches.size())];
  plan.requirements = first->requirements;
  plan.kind = first->listed ? "single" : "unlisted";
  if (kind == CaseRequest::Kind::pair) add_second_effect(plan, choices, random);
  const bool replaces_memory =
      std::any_of(plan.effects.begin(), plan.effects.end(), [](const HiddenEffect* each) {
        return each->id == "friction_memory" || each->id == "contact_compliance" ||
               each->id == "dwell_strengthening";
      });
  if (!replaces_memory && !plan.requirements.set_valued) {
    plan.requirements.relaxes = random.chance(0.35);
  }
  if (plan.bench == BenchKind::force && !plan.requirements.lacks_friction) {
    plan.requirements.lacks_friction = random.chance(0.6);
  }
  return plan;
}

// ---- A bench with effects of adjustable strength

struct Draft {
  Plan plan;
  Bench bench;  ///< without the effects
  Sizes sizes;
  bool noise_declared = true;
  std::vector<Tone> validation_drive;
  std::vector<RandomSource> effect_random;
  std::vector<double> strength;
  std::vector<double> target_snr;
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

// Empty if the bench without effects is not plausible.
std::optional<Draft> draw_draft(const CaseRequest& request, std::uint64_t effect_seed,
                                RandomSource& random) {
  Draft draft;
  draft.plan = draw_plan(request, random);
  draft.bench = draw_bench(draft.plan.bench, draft.plan.requirements, random);
  draft.noise_declared = random.chance(0.5);
  const double duration_s = std::round(request.duration_s * random.uniform(1.0, 1.3));
  const NoiselessRun plain = simulate(draft.bench.rig, draft.bench.sample_rate_hz, 8.0, false);
  if (!is_plausible(plain, draft.bench.rig)) return std::nullopt;
  measure(plain, draft.sizes);
  draft.sizes.duration_s = duration_s;
  draw_noise(draft, random);
  draft.validation_drive = draw_drive(draft.plan.bench, draft.bench.rig, random);
  for (std::size_t i = 0; i < draft.plan.effects.size(); ++i) {
    draft.effect_random.emplace_back(effect_seed + i);
    draft.strength.push_back(1.0);
    draft.target_snr.push_back(random.log_uniform(5.0, 35.0));
  }
  return draft;
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

enum class Visibility { sufficient, adjusted, insufficient };

// Fills in the signal-to-noise ratios of the effects and, unless it is the last attempt, moves the
// strengths towards their targets.
Visibility assess(Draft& draft, HiddenBench& hidden, const NoiselessRun& run, bool last_attempt) {
  const ReferenceRig& rig = hidden.bench.rig;
  const Eigen::MatrixXd shifts = prior_sensitivity(draft, rig, run);
  bool visible = true;
  bool again = false;
  for (std::size_t i = 0; i < draft.plan.effects.size(); ++i) {
    const ReferenceRig without = with_effects(draft, i).bench.rig;
    const Eigen::VectorXd change = difference(run, rig, without, draft.bench.sample_rate_hz);
    TrueEffect& effect = hidden.effects[i];
    effect.snr = root_mean_square(change);
    effect.snr_after_calibration = snr_after_calibration(change, shifts);
    const bool seen = effect.snr >= min_snr && effect.snr <= largest_snr * 4.0 &&
                      effect.snr_after_calibration >= min_snr_after_calibration;
    visible = visible && seen;
    const double target = draft.target_snr[i];
    const bool off = effect.snr > largest_snr || effect.snr < 0.8 * target || !seen;
    if (!draft.plan.effects[i]->scalable || !off || last_attempt) continue;
    double factor = target / std::max(effect.snr, 0.01);
    if (effect.snr_after_calibration < min_snr_after_calibration) {
      factor = std::max(factor, 2.0);
    }
    draft.strength[i] *= std::clamp(factor, 0.25, 4.0);
    again = again || !seen || effect.snr > largest_snr;
  }
  if (again) return Visibility::adjusted;
  return visible ? Visibility::sufficient : Visibility::insufficient;
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
  out.recording = recorded(run, hidden.bench, name + "/recording.csv", random);
  out.states = run.truth;
  ReferenceRig validation = hidden.bench.rig;
  validation.drive = draft.validation_drive;
  const NoiselessRun other = simulate(validation, draft.bench.sample_rate_hz,
                                      std::round(draft.sizes.duration_s * 2.0 / 3.0), false);
  if (!is_plausible(other, validation)) return std::nullopt;
  out.validation = recorded(other, hidden.bench, name + "/validation.csv", random);
  return out;
}

// Empty if the effects cannot be made visible on this bench; `attempt` counts the simulations.
std::optional<Case> case_of(Draft& draft, const std::string& name, int& attempt,
                            RandomSource& random) {
  constexpr int max_strengths = 6;
  for (int tried = 0; tried < max_strengths; ++tried) {
    ++attempt;
    HiddenBench hidden = with_effects(draft, draft.plan.effects.size());
    const NoiselessRun run =
        simulate(hidden.bench.rig, draft.bench.sample_rate_hz, draft.sizes.duration_s, true);
    if (!is_plausible(run, hidden.bench.rig)) {
      for (double& each : draft.strength) each *= 0.5;
      continue;
    }
    switch (assess(draft, hidden, run, tried + 1 == max_strengths)) {
      case Visibility::sufficient:
        return make_case(draft, hidden, run, name, random);
      case Visibility::insufficient:
        return std::nullopt;
      case Visibility::adjusted:
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
  throw Failure(name + ": no visible effect on 40 benches");
}

}  // namespace stickslip::concealment
