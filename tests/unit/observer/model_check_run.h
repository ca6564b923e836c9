// Seeded runs of a rig, with or without a change of its model, under the model check.
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
  bristle,    ///< compliant contact, 30 to 200 N/m
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

/// True if a verdict or an explanation names the relation that the change breaks.
template <class Result>
bool is_right(Change change, const Result& result) {
  using physics::Relation;
  const Relation relation = result.relation;
  const auto sensor = [&](Channel channel) {
    return relation == Relation::sensor && result.channel == channel;
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

/// A rig, its assumed model and its drive, drawn from a seed.
struct Scenario {
  physics::Model assumed;
  physics::Model real;
  ModulatedBase base;
  double rest_from_s = 1.0e9;  ///< the excitation pauses for 5 s of every 40
};

inline Scenario make_scenario(std::uint64_t seed, bool resonant_only = false) {
  std::mt19937_64 random(seed * 7919 + 17);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto pick = [&](int count) {
    return std::uniform_int_distribution<int>(0, count - 1)(random);
  };
  constexpr std::array laws = {Law::coulomb, Law::state_variable, Law::set_valued};
  Scenario out;
  const Law law = laws[static_cast<std::size_t>(pick(3))];
  const bool wedge = pick(2) == 1;
  const bool resonant = resonant_only || pick(4) != 0;
  out.assumed = paper_rig(law, wedge, resonant);
  out.real = out.assumed;
  // Errors of a careful identification.
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

/// As make_scenario, but driven so that the contact slides most of the time: some changes are not
/// observable while it sticks.
inline Scenario make_sliding_scenario(std::uint64_t seed, bool resonant_only = false) {
  Scenario out = make_scenario(seed, resonant_only);
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

/// Runs until `until_s` after the change, or until the alarm that follows it. If `frames` is given,
/// it receives all frames, and the run continues until they suffice for an explanation.
inline Outcome run_check(const Scenario& scenario, Change change, double change_s, double until_s,
                         std::uint64_t seed, const ModelCheckSettings& settings = {},
                         std::vector<Frame>* frames = nullptr) {
  constexpr int pieces = 6;
  std::mt19937_64 random(seed);
  ChangingRig rig(scenario.real, period_s / pieces, seed);
  FrictionObserver observer(scenario.assumed, period_s);
  ModelCheck check(scenario.assumed, period_s, settings);
  Outcome out;
  const auto drive = [&scenario](double t) {
    // A pause begins and ends at nodes of the modulation, without a jump.
    const double cycle = 1.0 / scenario.base.modulation_hz;
    const double node = std::ceil(scenario.rest_from_s / cycle) * cycle;
    const double rest = std::ceil(5.0 / cycle) * cycle;
    if (t < node) return scenario.base(t);
    return t < node + rest ? physics::Input{} : scenario.base(t);
  };
  const auto count = std::llround((change_s + until_s) / period_s);
  const auto change_at = std::llround(change_s / period_s);
  for (long long k = 1; k <= count; ++k) {
    if (k == change_at) {
      const int late = std::uniform_int_distribution<int>(3, 8)(random);
      if (change == Change::late_force) rig.delay(Channel::friction_force, late);
      if (change == Change::late_velocity) rig.delay(Channel::velocity, late);
      if (change == Change::late_displacement) rig.delay(Channel::displacement, late);
      const physics::Model next = changed(scenario.real, change, random);
      if (!(next == scenario.real)) rig.become(next);
    }
    for (int piece = 1; piece <= pieces; ++piece) {
      rig.step(
          drive((static_cast<double>(k - 1) + static_cast<double>(piece) / pieces) * period_s));
    }
    const Frame frame = rig.read();
    if (frames != nullptr) frames->push_back(frame);
    if (out.after_s) {
      // Frames after the alarm are used for its explanation.
      if (frame.time_ns >= explained_until_ns(out.verdict)) break;
      continue;
    }
    if (!check.update(observer.update(frame))) continue;
    if (check.verdict().status != ModelStatus::broken) continue;
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
