// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/hidden_rig.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "physics/catalogue.h"
#include "physics/failure.h"
#include "physics/model_consistency.h"
#include "physics/number_text.h"
#include "tools/concealment/rounding.h"

namespace stickslip::concealment {

namespace {

using physics::Model;
using physics::Parameter;

// Of a base-excited rig: a little more than the drives of cases need.
constexpr double displacement_limit_m = 0.012;
constexpr double velocity_limit_m_s = 0.4;
constexpr double acceleration_limit_m_s2 = 12.0;
// Of the deflection, far more than it needs: an interlock, which a study stays within.
constexpr double deflection_limit_m = 0.06;

std::optional<physics::Term> term_of(const TrueEffect& hidden) {
  const physics::Effect* effect = physics::find_effect(hidden.id);
  if (effect == nullptr) return std::nullopt;
  physics::Term out;
  out.id = hidden.id;
  out.channel = hidden.channel;
  for (const physics::ParameterCard& card : effect->card().parameters) {
    const auto found = hidden.parameters.find(std::string(card.name));
    if (found != hidden.parameters.end()) {
      out.parameters[found->first] = Parameter{found->second.value, 0.0};
    } else if (!card.fixed_default) {
      return std::nullopt;
    }
  }
  return out;
}

void set_true_numbers(const GroundTruth& truth, Model& model) {
  for (const physics::NamedParameter& each : physics::parameters_of(model)) {
    each.parameter->sigma = 0.0;
    const auto found = truth.parameters.find(each.path);
    if (found != truth.parameters.end()) each.parameter->value = found->second;
  }
  physics::Oscillator& oscillator = model.oscillator;
  const auto replace = [&truth](const char* path, auto& of_case, auto& declared) {
    const auto found = truth.parameters.find(path);
    if (found == truth.parameters.end() || !declared) return;
    declared.reset();
    of_case = Parameter{found->second, 0.0};
  };
  if (!oscillator.two_well) {
    replace("oscillator.stiffness_n_m", oscillator.stiffness_n_m, oscillator.natural_frequency_hz);
  }
  replace("oscillator.damping_n_s_m", oscillator.damping_n_s_m, oscillator.damping_ratio);
  for (const Channel channel : all_channels) {
    const auto noise = truth.noise_std.find(std::string(info(channel).column));
    if (noise != truth.noise_std.end()) model.sensors[index_of(channel)].noise_std = noise->second;
  }
}

double natural_hz(const physics::Oscillator& rig) {
  const auto of = [&rig](double stiffness) {
    return std::sqrt(stiffness / rig.mass_kg.value) / (2.0 * std::numbers::pi);
  };
  if (rig.stiffness_n_m) return of(rig.stiffness_n_m->value);
  return rig.natural_frequency_hz ? rig.natural_frequency_hz->value : 2.5;
}

// The largest force: of the spring at a deflection that cases reach, and of friction.
double force_limit_n(const Model& model) {
  const double omega = 2.0 * std::numbers::pi * natural_hz(model.oscillator);
  const double stiffness = model.oscillator.mass_kg.value * omega * omega;
  return rounded(0.008 * stiffness + 2.0 * model.friction.mu.value, 2);
}

}  // namespace

std::optional<HiddenRig> rig_of(const Case& made) {
  if (made.declared.oscillator.excitation == physics::Excitation::imposed) return std::nullopt;
  HiddenRig out{made.truth, made.declared, made.declared, made.recording.channels};
  set_true_numbers(made.truth, out.actual);
  for (const TrueEffect& hidden : made.truth.effects) {
    const auto term = term_of(hidden);
    if (!term) return std::nullopt;
    out.actual.terms.push_back(*term);
  }
  if (!physics::inconsistencies_of(out.actual).empty()) return std::nullopt;
  return out;
}

HiddenRig conceal_rig(const CaseRequest& request, std::uint64_t seed, const std::string& name) {
  constexpr std::uint64_t most_attempts = 40;
  for (std::uint64_t attempt = 0; attempt < most_attempts; ++attempt) {
    if (auto rig = rig_of(conceal(request, seed + attempt, name))) return *rig;
  }
  throw Failure("none of 40 cases is a rig with a drive whose physics the catalogue lists");
}

std::string rig_text(const HiddenRig& rig, const std::string& truth_file) {
  using physics::number_text;
  const bool force = rig.declared.oscillator.excitation == physics::Excitation::force;
  const double most = force ? force_limit_n(rig.declared) : displacement_limit_m;
  const auto number = [](double value) { return number_text(value, 9); };
  std::string out = "# A simulated rig with concealed physics; the truth is sealed (seal.txt).\n";
  out += "schema = 1\n\n[rig]\nname = \"" + rig.truth.name + "\"\nmodel = \"model.toml\"\n\n";
  out += "[driver]\nkind = \"simulated\"\n\n[driver.simulated]\ntruth = \"" + truth_file +
         "\"\nseed = " + std::to_string(rig.truth.seed) + "\n\n";
  out += "[driver.simulated.absent]\n";
  for (const Channel channel : all_channels) {
    if ((rig.channels >> index_of(channel)) & 1U) continue;
    out += std::string(info(channel).stem) + " = true\n";
  }
  out += "\n[loop]\nrate_hz = " + number(rig.truth.sample_rate_hz) + "\n\n";
  out += "[excitation]\nenabled = true\ncarrier_hz = " +
         number(rounded(natural_hz(rig.declared.oscillator), 3)) +
         "\namplitude = " + number(0.25 * most) + "\n\n[limits]\n";
  if (force) {
    out += "force_n = " + number(most) + "\nforce_slew_n_s = " + number(60.0 * most) + "\n";
  } else {
    out += "displacement_m = " + number(most) + "\nvelocity_m_s = " + number(velocity_limit_m_s) +
           "\nacceleration_m_s2 = " + number(acceleration_limit_m_s2) + "\n";
  }
  out += "\n[safety.range.displacement]\nlow = " + number(-deflection_limit_m) +
         "\nhigh = " + number(deflection_limit_m) + "\n";
  return out;
}

}  // namespace stickslip::concealment
