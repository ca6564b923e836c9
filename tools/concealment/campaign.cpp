// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/campaign.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "physics/failure.h"
#include "physics/number_text.h"
#include "tools/concealment/bench_drawing.h"
#include "tools/concealment/recorder.h"
#include "tools/concealment/rounding.h"

namespace stickslip::concealment {

namespace {

constexpr std::size_t run_count = 4;

struct Draft {
  Bench bench;
  std::vector<ReferenceRig> rigs;
  std::vector<double> loads_n;
  TrueEffect effect;
};

// A pressed contact in place of a friction force: the load is known, and another one in each run
// where the effect needs that.
void press(Bench& bench, RandomSource& random) {
  const double load_n = rounded(random.uniform(0.1, 0.3), 3);
  physics::Parameter& mu = bench.declared.friction.mu;
  mu = {rounded(mu.value / load_n, 3), rounded(mu.sigma / load_n, 2)};
  bench.rig.mu /= load_n;
  bench.rig.loaded = true;
  bench.rig.load_n = load_n;
  bench.declared.normal_load =
      physics::NormalLoad{physics::NormalLoadLaw::constant, {load_n, 0.0}, {}};
}

void scale_drive(ReferenceRig& rig, double factor) {
  for (Tone& tone : rig.drive) tone.amplitude *= factor;
}

TrueEffect effect_named(std::string id, std::vector<std::string> also, std::string relation,
                        std::string form) {
  TrueEffect out;
  out.id = std::move(id);
  out.accept = {out.id};
  out.accept.insert(out.accept.end(), also.begin(), also.end());
  out.relations = {std::move(relation)};
  out.form = std::move(form);
  return out;
}

void hide_load_dependence(Draft& draft, RandomSource& random) {
  constexpr std::array loads = {0.5, 0.8, 1.25, 2.0};
  const double exponent = random.sign() * random.uniform(0.12, 0.3);
  for (std::size_t i = 0; i < run_count; ++i) {
    ReferenceRig& rig = draft.rigs[i];
    rig.load_n *= loads[i];
    rig.mu *= std::pow(loads[i], exponent);
  }
  draft.effect = effect_named("load_dependent_mu", {"declared_value of friction.mu"},
                              "friction_law", "mu (N / N0)^exponent");
  draft.effect.parameters["exponent"] = {exponent};
}

void hide_drift(Draft& draft, RandomSource& random) {
  const bool of_friction = random.chance(0.5);
  const double step =
      random.sign() * (of_friction ? random.uniform(0.05, 0.1) : random.uniform(0.008, 0.02));
  for (std::size_t i = 0; i < run_count; ++i) {
    const double factor = 1.0 + step * (static_cast<double>(i) - 0.5 * (run_count - 1));
    (of_friction ? draft.rigs[i].mu : draft.rigs[i].stiffness_n_m) *= factor;
  }
  const bool by_frequency = draft.bench.declared.oscillator.natural_frequency_hz.has_value();
  const std::string path = of_friction    ? "friction.mu"
                           : by_frequency ? "oscillator.natural_frequency_hz"
                                          : "oscillator.stiffness_n_m";
  draft.effect =
      effect_named("declared_value of " + path, {}, of_friction ? "friction_law" : "force_balance",
                   path + " changes from run to run");
}

void hide_amplitude_damping(Draft& draft, RandomSource& random) {
  constexpr std::array amplitudes = {0.5, 0.8, 1.25, 2.0};
  const ReferenceRig& rig = draft.bench.rig;
  const double speed_m_s = std::sqrt(rig.stiffness_n_m / rig.mass_kg) * 0.004;
  // Of the viscous damping at that speed.
  const double share = random.uniform(0.3, 0.6);
  for (std::size_t i = 0; i < run_count; ++i) {
    scale_drive(draft.rigs[i], amplitudes[i]);
    draft.rigs[i].drag = share * rig.damping_n_s_m / speed_m_s;
  }
  draft.effect = effect_named("quadratic_drag", {}, "force_balance", "drag abs(v) v");
  draft.effect.parameters["drag_n_s2_m2"] = {draft.rigs[0].drag};
}

void hide_fault(Draft& draft, RandomSource& random) {
  const std::size_t run = random.index(run_count);
  const Channel channel = random.chance(0.5) ? Channel::displacement : Channel::drive_force;
  const double gain = 1.0 + random.sign() * random.uniform(0.02, 0.05);
  draft.rigs[run].instrument[index_of(channel)].gain = gain;
  draft.effect =
      effect_named("gain_error", {}, "sensor", "gain in run " + std::to_string(run + 1) + " alone");
  draft.effect.channel = channel;
  draft.effect.parameters["gain"] = {gain, 0.25, 1.0, false};
}

std::optional<Draft> draw(const std::optional<CampaignEffect>& effect, RandomSource& random) {
  Draft out;
  out.bench = draw_bench(BenchKind::force, {}, random);
  press(out.bench, random);
  for (std::size_t i = 0; i < run_count; ++i) {
    out.rigs.push_back(out.bench.rig);
    for (Tone& tone : out.rigs.back().drive) {
      tone.phase_rad = random.uniform(0.0, 6.283);
      tone.frequency_hz *= random.uniform(0.95, 1.05);
    }
  }
  if (effect == CampaignEffect::load_dependent_mu) hide_load_dependence(out, random);
  if (effect == CampaignEffect::run_drift) hide_drift(out, random);
  if (effect == CampaignEffect::amplitude_damping) hide_amplitude_damping(out, random);
  if (effect == CampaignEffect::faulty_channel) hide_fault(out, random);
  return out;
}

std::optional<CampaignCase> case_of(Draft& draft, double duration_s, const std::string& name,
                                    RandomSource& random) {
  CampaignCase out;
  out.declared = draft.bench.declared;
  const SampleTimes times = sample_times({draft.bench.sample_rate_hz}, duration_s, random);
  std::vector<NoiselessRun> runs;
  for (const ReferenceRig& rig : draft.rigs) {
    runs.push_back(simulate(rig, times.sampled_s, false));
    if (!is_plausible(runs.back(), rig)) return std::nullopt;
  }
  Sizes sizes;
  measure(runs.front(), sizes);
  std::array<double, channel_count> noise{};
  for (std::size_t c = 0; c < channel_count; ++c) {
    noise[c] = rounded(random.log_uniform(0.003, 0.01) * sizes.spread[c], 2);
  }
  for (std::size_t i = 0; i < run_count; ++i) {
    ReferenceRig& rig = draft.rigs[i];
    for (const Channel channel : all_channels) {
      Instrument& instrument = rig.instrument[index_of(channel)];
      if (!instrument.recorded) continue;
      instrument.noise_std = noise[index_of(channel)];
      instrument.resolution = round_step(0.3 * instrument.noise_std);
      out.declared.sensors[index_of(channel)].noise_std = instrument.noise_std;
      out.truth.noise_std[std::string(info(channel).column)] = instrument.noise_std;
    }
    physics::Run run;
    run.name = "run " + std::to_string(i + 1);
    run.conditions["load_n"] = rounded(rig.load_n, 6);
    out.campaign.runs.push_back(run);
    out.recordings.push_back(recorded(runs[i], times, rig, name + "/" + run.name, random));
  }
  out.truth.duration_s = duration_s;
  out.truth.sample_rate_hz = draft.bench.sample_rate_hz;
  return out;
}

}  // namespace

std::string_view name_of(CampaignEffect effect) {
  switch (effect) {
    case CampaignEffect::load_dependent_mu:
      return "load_dependent_mu";
    case CampaignEffect::run_drift:
      return "run_drift";
    case CampaignEffect::amplitude_damping:
      return "amplitude_damping";
    case CampaignEffect::faulty_channel:
      return "faulty_channel";
  }
  return "";
}

CampaignCase conceal_campaign(const std::optional<CampaignEffect>& effect, double duration_s,
                              std::uint64_t seed, const std::string& name) {
  RandomSource random(seed);
  constexpr int max_benches = 40;
  for (int attempt = 1; attempt <= max_benches; ++attempt) {
    std::optional<Draft> draft = draw(effect, random);
    if (!draft) continue;
    std::optional<CampaignCase> made = case_of(*draft, duration_s, name, random);
    if (!made) continue;
    GroundTruth& truth = made->truth;
    truth.name = name;
    truth.kind = effect ? "single" : "null";
    truth.world = effect ? name_of(*effect) : "force";
    truth.verdict = effect ? "missing_physics" : "consistent";
    truth.seed = seed;
    truth.attempt = attempt;
    truth.validation_graded = false;
    if (effect) truth.effects.push_back(draft->effect);
    return *std::move(made);
  }
  throw Failure(name + ": none of 40 benches moves plausibly");
}

std::string campaign_text(const CampaignCase& made) {
  std::string out = "schema = 1\nmodel = \"model.toml\"\n";
  for (std::size_t i = 0; i < made.campaign.runs.size(); ++i) {
    const physics::Run& run = made.campaign.runs[i];
    out += "\n[[recording]]\nname = \"" + run.name + "\"\nfile = \"run-" + std::to_string(i + 1) +
           "/recording.csv\"\nconditions = { load_n = " +
           physics::number_text(run.conditions.at("load_n"), 6) + " }\n";
  }
  return out;
}

}  // namespace stickslip::concealment
