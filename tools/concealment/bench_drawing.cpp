// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/bench_drawing.h"

#include <cmath>
#include <numbers>
#include <utility>

#include "tools/concealment/rounding.h"

namespace stickslip::concealment {

namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

// A declared parameter with its prior, and the true value drawn from it.
struct UncertainParameter {
  physics::Parameter declared;
  double truth = 0.0;
};
UncertainParameter draw_parameter(double value, double sigma, RandomSource& random) {
  UncertainParameter out;
  out.declared = {rounded(value, 3), rounded(sigma, 2)};
  // The prior is truncated at 2.5 standard deviations.
  double deviation = random.normal();
  while (std::abs(deviation) > 2.5) deviation = random.normal();
  out.truth = out.declared.value + out.declared.sigma * deviation;
  return out;
}

// A perturbation of one parameter by its standard deviation.
std::function<void(ReferenceRig&)> shift_of(double ReferenceRig::*parameter,
                                            const UncertainParameter& drawn) {
  return [parameter, sigma = drawn.declared.sigma](ReferenceRig& rig) { rig.*parameter += sigma; };
}

physics::Filter lowpass(int order, double cutoff_hz) {
  return {order == 1 ? physics::FilterKind::first_order_lowpass
                     : physics::FilterKind::butterworth_lowpass,
          order,
          {cutoff_hz}};
}

double draw_mass(Bench& bench, RandomSource& random) {
  const double mass_kg = random.uniform(0.055, 0.066);
  const UncertainParameter mass = draw_parameter(mass_kg, 0.01 * mass_kg, random);
  bench.declared.oscillator.mass_kg = mass.declared;
  bench.rig.mass_kg = mass.truth;
  // With a declared natural frequency, stiffness and damping scale with the mass.
  const bool by_frequency = bench.kind != BenchKind::two_well;
  bench.prior_shifts.emplace_back([sigma = mass.declared.sigma, by_frequency](ReferenceRig& rig) {
    const double more = 1.0 + sigma / rig.mass_kg;
    rig.mass_kg *= more;
    if (!by_frequency) return;
    rig.stiffness_n_m *= more;
    rig.damping_n_s_m *= more;
  });
  return mass_kg;
}

void draw_two_well(Bench& bench, RandomSource& random) {
  physics::Oscillator& oscillator = bench.declared.oscillator;
  oscillator.natural_frequency_hz = physics::Parameter{2.4, 0.0};
  const double linear = random.uniform(12.0, 32.0);
  const double at_m = random.uniform(0.009, 0.012);
  const UncertainParameter a = draw_parameter(linear, 0.04 * linear, random);
  const UncertainParameter b =
      draw_parameter(linear / (at_m * at_m), 0.05 * linear / (at_m * at_m), random);
  oscillator.two_well = physics::TwoWell{a.declared, b.declared};
  bench.rig.well_linear_n_m = a.truth;
  bench.rig.well_cubic_n_m3 = b.truth;
  bench.prior_shifts.push_back(shift_of(&ReferenceRig::well_linear_n_m, a));
  bench.prior_shifts.push_back(shift_of(&ReferenceRig::well_cubic_n_m3, b));
}

// Returns the natural frequency [rad/s].
double draw_spring(Bench& bench, double mass_kg, RandomSource& random) {
  physics::Oscillator& oscillator = bench.declared.oscillator;
  ReferenceRig& rig = bench.rig;
  const double frequency_hz = random.chance(0.5) ? 2.4 : 3.6;
  double omega = two_pi * frequency_hz;
  if (bench.kind == BenchKind::two_well) {
    draw_two_well(bench, random);
    omega = two_pi * 2.4;
  } else if (bench.kind == BenchKind::force && random.chance(0.5)) {
    const double stiffness = mass_kg * omega * omega;
    const UncertainParameter k = draw_parameter(stiffness, 0.04 * stiffness, random);
    oscillator.stiffness_n_m = k.declared;
    rig.stiffness_n_m = k.truth;
    bench.prior_shifts.push_back(shift_of(&ReferenceRig::stiffness_n_m, k));
  } else {
    const UncertainParameter f = draw_parameter(frequency_hz, 0.05, random);
    oscillator.natural_frequency_hz = f.declared;
    omega = two_pi * f.truth;
    rig.stiffness_n_m = rig.mass_kg * omega * omega;
    bench.prior_shifts.emplace_back(
        [more = 1.0 + f.declared.sigma / f.truth](ReferenceRig& shifted) {
          shifted.stiffness_n_m *= more * more;
          shifted.damping_n_s_m *= more;
        });
  }
  return omega;
}

void draw_damping(Bench& bench, double mass_kg, double omega, RandomSource& random) {
  physics::Oscillator& oscillator = bench.declared.oscillator;
  ReferenceRig& rig = bench.rig;
  const double ratio = bench.kind == BenchKind::force ? 0.03 : 0.015;
  if (oscillator.stiffness_n_m) {
    const double damping = 2.0 * ratio * mass_kg * omega;
    const UncertainParameter c = draw_parameter(damping, 0.25 * damping, random);
    oscillator.damping_n_s_m = c.declared;
    rig.damping_n_s_m = std::max(c.truth, 0.1 * damping);
    bench.prior_shifts.push_back(shift_of(&ReferenceRig::damping_n_s_m, c));
  } else {
    const UncertainParameter zeta = draw_parameter(ratio, 0.005, random);
    oscillator.damping_ratio = zeta.declared;
    rig.damping_n_s_m = 2.0 * std::max(zeta.truth, 0.002) * rig.mass_kg * omega;
    bench.prior_shifts.emplace_back([more = 2.0 * zeta.declared.sigma * rig.mass_kg * omega](
                                        ReferenceRig& shifted) { shifted.damping_n_s_m += more; });
  }
}

void draw_oscillator(Bench& bench, RandomSource& random) {
  physics::Excitation& declared = bench.declared.oscillator.excitation;
  if (bench.kind == BenchKind::imposed) {
    declared = bench.rig.excitation = physics::Excitation::imposed;
    return;
  }
  declared = bench.rig.excitation =
      bench.kind == BenchKind::force ? physics::Excitation::force : physics::Excitation::base;
  const double mass_kg = draw_mass(bench, random);
  const double omega = draw_spring(bench, mass_kg, random);
  draw_damping(bench, mass_kg, omega, random);
}

void draw_normal_load(Bench& bench, RandomSource& random) {
  if (bench.kind == BenchKind::force) {
    bench.rig.loaded = false;
    return;
  }
  const bool wedge = bench.kind == BenchKind::skewed || bench.kind == BenchKind::motivational;
  physics::NormalLoad load;
  load.law = wedge ? physics::NormalLoadLaw::wedge : physics::NormalLoadLaw::constant;
  const double newtons = wedge ? random.uniform(0.12, 0.35) : random.uniform(0.1, 0.27);
  const UncertainParameter value = draw_parameter(newtons, newtons < 0.2 ? 0.01 : 0.015, random);
  load.load_n = value.declared;
  bench.rig.load_n = value.truth;
  bench.prior_shifts.push_back(shift_of(&ReferenceRig::load_n, value));
  if (wedge) {
    const double slope = random.uniform(180.0, 320.0);
    const UncertainParameter s = draw_parameter(slope, 0.08 * slope, random);
    load.slope_per_m = s.declared;
    bench.rig.load_slope_per_m = s.truth;
    bench.prior_shifts.push_back(shift_of(&ReferenceRig::load_slope_per_m, s));
  }
  bench.declared.normal_load = load;
}

void draw_friction(Bench& bench, const BenchRequirements& requirements, RandomSource& random) {
  physics::Friction& friction = bench.declared.friction;
  ReferenceRig& rig = bench.rig;
  if (bench.kind == BenchKind::force && requirements.lacks_friction) {
    friction.law = physics::FrictionLaw::none;
    rig.friction = false;
    return;
  }
  friction.law = physics::FrictionLaw::coulomb;
  const bool in_newtons = !rig.loaded;
  const double mu = in_newtons ? random.uniform(0.004, 0.012) : random.uniform(0.3, 0.8);
  const UncertainParameter coefficient =
      draw_parameter(mu, in_newtons ? 0.15 * mu : (mu > 0.5 ? 0.1 : 0.05), random);
  friction.mu = coefficient.declared;
  rig.mu = coefficient.truth;
  bench.prior_shifts.push_back(shift_of(&ReferenceRig::mu, coefficient));
  rig.transition_speed_m_s =
      requirements.set_valued ? 0.0 : rounded(random.uniform(0.0014, 0.004), 3);
  friction.transition_speed_m_s = {rig.transition_speed_m_s, 0.0};
  if (!requirements.relaxes) return;
  friction.law = physics::FrictionLaw::state_variable;
  const double rate = random.uniform(90.0, 250.0);
  const UncertainParameter gamma = draw_parameter(rate, 0.15 * rate, random);
  friction.rate_per_s = gamma.declared;
  rig.relaxation_per_s = gamma.truth;
  bench.prior_shifts.push_back(shift_of(&ReferenceRig::relaxation_per_s, gamma));
}

void draw_load_cell(Bench& bench, bool rings, RandomSource& random) {
  physics::LoadCell cell;
  cell.dynamics =
      rings ? physics::LoadCellDynamics::resonant : physics::LoadCellDynamics::quasi_static;
  const UncertainParameter mass = draw_parameter(0.0126, 0.0001, random);
  const UncertainParameter frequency = draw_parameter(19.3, 0.2, random);
  const UncertainParameter ratio = draw_parameter(0.016, 0.003, random);
  const bool exact = random.chance(0.5);
  const auto declared = [exact](const UncertainParameter& each) {
    return exact ? physics::Parameter{each.declared.value, 0.0} : each.declared;
  };
  const auto truth = [exact](const UncertainParameter& each) {
    return exact ? each.declared.value : each.truth;
  };
  cell.mass_kg = declared(mass);
  cell.natural_frequency_hz = declared(frequency);
  cell.damping_ratio = declared(ratio);
  ReferenceRig& rig = bench.rig;
  rig.cell = true;
  rig.cell_rings = rings;
  rig.cell_mass_kg = truth(mass);
  rig.cell_frequency_hz = truth(frequency);
  rig.cell_damping_ratio = std::max(truth(ratio), 0.004);
  bench.declared.load_cell = cell;
  if (exact) return;
  bench.prior_shifts.push_back(shift_of(&ReferenceRig::cell_mass_kg, mass));
  bench.prior_shifts.push_back(shift_of(&ReferenceRig::cell_frequency_hz, frequency));
  bench.prior_shifts.push_back(shift_of(&ReferenceRig::cell_damping_ratio, ratio));
}

void add_channels(Bench& bench) {
  const auto add = [&](Channel channel, std::vector<physics::Filter> filters) {
    Instrument& instrument = bench.rig.instrument[index_of(channel)];
    instrument.recorded = true;
    instrument.filters = filters;
    bench.declared.sensors[index_of(channel)].filters = std::move(filters);
  };
  add(Channel::displacement, {lowpass(4, 25.0)});
  if (bench.kind != BenchKind::force) add(Channel::velocity, {lowpass(1, 150.0)});
  if (bench.rig.cell || bench.kind == BenchKind::imposed) {
    add(Channel::friction_force, {lowpass(4, 100.0)});
  }
  if (bench.declared.normal_load) add(Channel::normal_load, {lowpass(4, 100.0)});
  if (bench.rig.excitation == physics::Excitation::base) {
    add(Channel::base_displacement, {lowpass(4, 25.0)});
  }
  if (bench.rig.excitation == physics::Excitation::force) add(Channel::drive_force, {});
}

}  // namespace

std::string_view name_of(BenchKind kind) {
  switch (kind) {
    case BenchKind::regular:
      return "regular";
    case BenchKind::skewed:
      return "skewed";
    case BenchKind::two_well:
      return "twowell";
    case BenchKind::motivational:
      return "motivational";
    case BenchKind::force:
      return "force";
    case BenchKind::imposed:
      return "imposed";
  }
  return "";
}

std::vector<Tone> draw_drive(BenchKind kind, const ReferenceRig& rig, RandomSource& random) {
  Tone tone;
  const double natural_hz = std::sqrt(rig.stiffness_n_m / rig.mass_kg) / two_pi;
  tone.phase_rad = random.uniform(0.0, two_pi);
  double depth = 0.5;
  switch (kind) {
    case BenchKind::regular:
      tone.frequency_hz = natural_hz * random.uniform(0.75, 1.4);
      tone.amplitude = random.uniform(0.0050, 0.0085);
      break;
    case BenchKind::skewed:
      tone.frequency_hz = natural_hz * random.uniform(0.9, 1.7);
      tone.amplitude = random.uniform(0.0040, 0.0085);
      depth = 0.15;
      break;
    case BenchKind::two_well:
      tone.frequency_hz = random.uniform(2.5, 4.5);
      tone.amplitude = random.uniform(0.0065, 0.0095);
      depth = 0.1;
      break;
    case BenchKind::motivational:
      tone.frequency_hz = natural_hz * random.uniform(0.9, 1.6);
      tone.amplitude = random.uniform(0.0060, 0.0095);
      depth = 0.15;
      break;
    case BenchKind::force: {
      tone.frequency_hz = natural_hz * random.uniform(0.7, 1.3);
      // Force for a static deflection of this size, friction added.
      tone.amplitude =
          rig.stiffness_n_m * random.uniform(0.002, 0.005) + (rig.friction ? rig.mu : 0.0);
      break;
    }
    case BenchKind::imposed:
      tone.frequency_hz = random.uniform(1.5, 3.0);
      tone.amplitude = random.uniform(0.004, 0.009);
      break;
  }
  const std::array<double, 3> slow_hz = {random.uniform(0.05, 0.1), random.uniform(0.1, 0.2),
                                         random.uniform(0.2, 0.35)};
  for (std::size_t i = 0; i < slow_hz.size(); ++i) {
    tone.envelope[i] = {depth * random.uniform(0.25, 0.55), slow_hz[i],
                        random.uniform(0.0, two_pi)};
  }
  std::vector<Tone> tones{tone};
  if (kind == BenchKind::force || kind == BenchKind::imposed) {
    Tone second = tone;
    second.amplitude *= random.uniform(0.2, 0.5);
    second.frequency_hz *= random.uniform(1.5, 2.3);
    second.phase_rad = random.uniform(0.0, two_pi);
    tones.push_back(second);
  }
  return tones;
}

Bench draw_bench(BenchKind kind, const BenchRequirements& requirements, RandomSource& random) {
  Bench bench;
  bench.kind = kind;
  if (kind == BenchKind::force) bench.sample_rate_hz = random.chance(0.4) ? 1000.0 : 500.0;
  draw_oscillator(bench, random);
  draw_normal_load(bench, random);
  draw_friction(bench, requirements, random);
  if (kind == BenchKind::regular || kind == BenchKind::skewed || kind == BenchKind::two_well) {
    draw_load_cell(bench, requirements.rings, random);
  }
  add_channels(bench);
  bench.rig.drive = draw_drive(kind, bench.rig, random);
  return bench;
}

}  // namespace stickslip::concealment
