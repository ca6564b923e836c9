// A seeded run of a rig that changes on its way, or does not, and what the model check says of it.
#pragma once

#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <string_view>
#include <vector>

#include "observer/explanation.h"
#include "observer/model_check.h"
#include "tests/unit/observer/bench.h"
#include "tests/unit/observer/changing_rig.h"

namespace stickslip::observer::test {

enum class Change {
  none,
  mu_up,
  mu_down,
  load_cell,   ///< its natural frequency falls by 20 to 40 %
  late_force,  ///< the channel, by 3 to 8 ms
  late_velocity,
  late_displacement,
  bristle,    ///< the contact yields, 30 to 200 N/m
  stiffness,  ///< the spring, by 20 % (natural frequency 10 %)
};

inline constexpr std::array changes = {
    Change::mu_up,         Change::mu_down,           Change::load_cell, Change::late_force,
    Change::late_velocity, Change::late_displacement, Change::bristle,   Change::stiffness};

inline std::string_view name_of(Change change) {
  constexpr std::array<std::string_view, 9> names = {
      "none",          "mu up 20 %",        "mu down 20 %", "loose load cell",         "late force",
      "late velocity", "late displacement", "bristle",      "softer or stiffer spring"};
  return names[static_cast<std::size_t>(change)];
}

/// Whether a name of the relation is right. `named`: a verdict or an explanation.
template <class Named>
bool is_right(Change change, const Named& named) {
  using physics::Relation;
  const Relation relation = named.relation;
  const auto sensor = [&](Channel channel) {
    return relation == Relation::sensor && named.channel == channel;
  };
  switch (change) {
    case Change::none:
      return false;
    case Change::mu_up:
    case Change::mu_down:
    case Change::bristle:
      return relation == Relation::friction_law;
    case Change::load_cell:
      return relation == Relation::load_cell;
    case Change::late_force:
      return sensor(Channel::friction_force);
    case Change::late_velocity:
      return sensor(Channel::velocity) || relation == Relation::kinematics;
    case Change::late_displacement:
      return sensor(Channel::displacement);
    case Change::stiffness:
      return relation == Relation::force_balance;
  }
  return false;
}

/// A rig, what is believed of it, and how it is driven, drawn from a seed.
struct Scene {
  physics::Model believed;
  physics::Model real;
  ModulatedBase base;
  double rest_from_s = 1.0e9;  ///< the excitation pauses for 5 s of every 40
};

inline Scene scene_of(std::uint64_t seed, bool resonant_only = false) {
  std::mt19937_64 random(seed * 7919 + 17);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto pick = [&](int count) {
    return std::uniform_int_distribution<int>(0, count - 1)(random);
  };
  constexpr std::array laws = {Law::coulomb, Law::state_variable, Law::set_valued};
  Scene out;
  const Law law = laws[static_cast<std::size_t>(pick(3))];
  const bool wedge = pick(2) == 1;
  const bool resonant = resonant_only || pick(4) != 0;
  out.believed = paper_rig(law, wedge, resonant);
  out.real = out.believed;
  // As well as a careful person knows a rig.
  out.real.oscillator.mass_kg.value *= uniform(0.99, 1.01);
  out.real.oscillator.natural_frequency_hz->value *= uniform(0.995, 1.005);
  out.real.oscillator.damping_ratio->value *= uniform(0.8, 1.2);
  out.real.friction.mu.value *= uniform(0.8, 1.2);
  out.real.load_cell->natural_frequency_hz.value *= uniform(0.995, 1.005);
  out.real.load_cell->damping_ratio.value *= uniform(0.8, 1.2);
  if (wedge) out.real.normal_load->slope_per_m.value *= uniform(0.97, 1.03);
  out.base.amplitude_m = uniform(0.006, 0.014);
  out.base.carrier_hz = uniform(2.4, 3.8);
  out.base.modulation_hz = uniform(0.05, 0.3);
  if (pick(3) == 0) out.rest_from_s = uniform(20.0, 40.0);
  return out;
}

/// The same, driven so that the contact slides for most of the time: while it sticks a change of
/// what only sliding shows cannot be seen.
inline Scene sliding_scene_of(std::uint64_t seed, bool resonant_only = false) {
  Scene out = scene_of(seed, resonant_only);
  std::mt19937_64 random(seed * 104729 + 5);
  out.base.amplitude_m = std::uniform_real_distribution<double>(0.012, 0.016)(random);
  out.base.modulation_hz = std::uniform_real_distribution<double>(0.15, 0.3)(random);
  out.rest_from_s = 1.0e9;
  return out;
}

inline physics::Model changed(const physics::Model& model, Change change, std::mt19937_64& random) {
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  physics::Model out = model;
  switch (change) {
    case Change::mu_up:
      out.friction.mu.value *= 1.2;
      break;
    case Change::mu_down:
      out.friction.mu.value *= 0.8;
      break;
    case Change::load_cell:
      out.load_cell->natural_frequency_hz.value *= uniform(0.6, 0.8);
      break;
    case Change::bristle:
      out.terms.push_back(
          {"contact_compliance",
           std::nullopt,
           {{"contact_stiffness_n_m", {uniform(30.0, 200.0)}}, {"contact_damping_n_s_m", {0.1}}}});
      break;
    case Change::stiffness:
      out.oscillator.natural_frequency_hz->value *= uniform(0.0, 1.0) < 0.5 ? 0.9 : 1.1;
      break;
    default:
      break;
  }
  return out;
}

struct Outcome {
  std::uint64_t alarms_before = 0;
  std::optional<double> after_s;  ///< from the change to the alarm
  double onset_error_s = 0.0;
  ModelVerdict verdict;
  Signature signature;
};

inline constexpr double period_s = 1.0e-3;

/// Runs until `until_s` after the change, or until the alarm that follows it; where `frames` is
/// given, it receives all frames and the run goes on until they can be explained.
inline Outcome run_check(const Scene& scene, Change change, double change_s, double until_s,
                         std::uint64_t seed, const ModelCheckSettings& settings = {},
                         std::vector<Frame>* frames = nullptr) {
  constexpr int pieces = 6;
  std::mt19937_64 random(seed);
  ChangingRig rig(scene.real, period_s / pieces, seed);
  FrictionObserver observer(scene.believed, period_s);
  ModelCheck check(scene.believed, period_s, settings);
  Outcome out;
  const auto drive = [&scene](double t) {
    // The modulation's own nodes are where a pause can begin without a jump.
    const double cycle = 1.0 / scene.base.modulation_hz;
    const double node = std::ceil(scene.rest_from_s / cycle) * cycle;
    const double rest = std::ceil(5.0 / cycle) * cycle;
    if (t < node) return scene.base(t);
    return t < node + rest ? physics::Input{} : scene.base(t);
  };
  const auto count = std::llround((change_s + until_s) / period_s);
  const auto change_at = std::llround(change_s / period_s);
  for (long long k = 1; k <= count; ++k) {
    if (k == change_at) {
      const int late = std::uniform_int_distribution<int>(3, 8)(random);
      if (change == Change::late_force) rig.delay(Channel::friction_force, late);
      if (change == Change::late_velocity) rig.delay(Channel::velocity, late);
      if (change == Change::late_displacement) rig.delay(Channel::displacement, late);
      const physics::Model next = changed(scene.real, change, random);
      if (!(next == scene.real)) rig.become(next);
    }
    for (int piece = 1; piece <= pieces; ++piece) {
      rig.step(
          drive((static_cast<double>(k - 1) + static_cast<double>(piece) / pieces) * period_s));
    }
    const Frame frame = rig.read();
    if (frames != nullptr) frames->push_back(frame);
    if (out.after_s) {
      // What follows the alarm helps to explain it.
      if (frame.time_ns >= explained_until_ns(out.verdict)) break;
      continue;
    }
    if (!check.update(observer.update(frame))) continue;
    if (check.verdict().standing != ModelStanding::broken) continue;
    if (k < change_at || change == Change::none) {
      ++out.alarms_before;
      out.verdict = check.verdict();
      out.signature = check.signature();
      continue;
    }
    out.after_s = rig.time_s() - change_s;
    out.verdict = check.verdict();
    out.signature = check.signature();
    out.onset_error_s = 1.0e-9 * static_cast<double>(out.verdict.since_ns) - change_s;
    if (frames == nullptr) break;
  }
  return out;
}

}  // namespace stickslip::observer::test
