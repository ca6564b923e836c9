#include "tools/concealment/world.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>

namespace stickslip::concealment {

namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

// As an owner writes it down: with so many digits.
double rounded(double value, int digits) {
  char text[40];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return std::strtod(text, nullptr);
}

// A number that its owner knows with a sigma, and its true value.
struct Known {
  physics::Parameter declared;
  double truth = 0.0;
};
Known known(double value, double sigma, Dice& dice) {
  Known out;
  out.declared = {rounded(value, 3), rounded(sigma, 2)};
  // Nobody's estimate is off by more than 2.5 sigma here: the rest is drawn again.
  double off = dice.normal();
  while (std::abs(off) > 2.5) off = dice.normal();
  out.truth = out.declared.value + out.declared.sigma * off;
  return out;
}

physics::Filter lowpass(int order, double cutoff_hz) {
  return {order == 1 ? physics::FilterKind::first_order_lowpass
                     : physics::FilterKind::butterworth_lowpass,
          order, cutoff_hz};
}

}  // namespace

double Dice::uniform(double low, double high) {
  const double unit = static_cast<double>(engine_() >> 11U) * 0x1.0p-53;
  return low + (high - low) * unit;
}

double Dice::log_uniform(double low, double high) {
  return low * std::exp(uniform(0.0, 1.0) * std::log(high / low));
}

double Dice::normal() {
  // Box and Muller; 1 - u is never 0.
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform(0.0, 1.0)));
  return radius * std::cos(two_pi * uniform(0.0, 1.0));
}

std::size_t Dice::pick(std::size_t count) {
  return static_cast<std::size_t>(uniform(0.0, static_cast<double>(count)));
}

std::string_view name_of(World world) {
  switch (world) {
    case World::regular:
      return "regular";
    case World::skewed:
      return "skewed";
    case World::two_well:
      return "twowell";
    case World::motivational:
      return "motivational";
    case World::force:
      return "force";
    case World::imposed:
      return "imposed";
  }
  return "";
}

std::vector<Tone> draw_drive(World world, const Nature& nature, Dice& dice) {
  Tone tone;
  const double own_hz = std::sqrt(nature.stiffness_n_m / nature.mass_kg) / two_pi;
  tone.phase_rad = dice.uniform(0.0, two_pi);
  double depth = 0.5;
  switch (world) {
    case World::regular:
      tone.frequency_hz = own_hz * dice.uniform(0.75, 1.4);
      tone.amplitude = dice.uniform(0.0050, 0.0085);
      break;
    case World::skewed:
      tone.frequency_hz = own_hz * dice.uniform(0.9, 1.7);
      tone.amplitude = dice.uniform(0.0040, 0.0085);
      depth = 0.15;
      break;
    case World::two_well:
      tone.frequency_hz = dice.uniform(2.5, 4.5);
      tone.amplitude = dice.uniform(0.0065, 0.0095);
      depth = 0.1;
      break;
    case World::motivational:
      tone.frequency_hz = own_hz * dice.uniform(0.9, 1.6);
      tone.amplitude = dice.uniform(0.0060, 0.0095);
      depth = 0.15;
      break;
    case World::force: {
      tone.frequency_hz = own_hz * dice.uniform(0.7, 1.3);
      // The force at which the spring alone would let it swing by so much.
      tone.amplitude =
          nature.stiffness_n_m * dice.uniform(0.002, 0.005) + (nature.friction ? nature.mu : 0.0);
      break;
    }
    case World::imposed:
      tone.frequency_hz = dice.uniform(1.5, 3.0);
      tone.amplitude = dice.uniform(0.004, 0.009);
      break;
  }
  const std::array<double, 3> slow_hz = {dice.uniform(0.05, 0.1), dice.uniform(0.1, 0.2),
                                         dice.uniform(0.2, 0.35)};
  for (std::size_t i = 0; i < slow_hz.size(); ++i) {
    tone.envelope[i] = {depth * dice.uniform(0.25, 0.55), slow_hz[i], dice.uniform(0.0, two_pi)};
  }
  std::vector<Tone> tones{tone};
  if (world == World::force || world == World::imposed) {
    Tone second = tone;
    second.amplitude *= dice.uniform(0.2, 0.5);
    second.frequency_hz *= dice.uniform(1.5, 2.3);
    second.phase_rad = dice.uniform(0.0, two_pi);
    tones.push_back(second);
  }
  return tones;
}

Rig draw_rig(World world, const Wishes& wishes, Dice& dice) {
  Rig rig;
  rig.world = world;
  physics::Model& m = rig.believed;
  Nature& n = rig.nature;
  if (world == World::force) rig.sample_rate_hz = dice.chance(0.4) ? 1000.0 : 500.0;

  if (world == World::imposed) {
    m.oscillator.excitation = n.excitation = physics::Excitation::imposed;
  } else {
    m.oscillator.excitation = n.excitation =
        world == World::force ? physics::Excitation::force : physics::Excitation::base;
    const double mass_kg = dice.uniform(0.055, 0.066);
    const Known mass = known(mass_kg, 0.01 * mass_kg, dice);
    m.oscillator.mass_kg = mass.declared;
    n.mass_kg = mass.truth;
    const bool by_frequency = world != World::two_well;
    rig.shifts.emplace_back([sigma = mass.declared.sigma, by_frequency](Nature& nature) {
      const double more = 1.0 + sigma / nature.mass_kg;
      nature.mass_kg *= more;
      if (!by_frequency) return;
      nature.stiffness_n_m *= more;
      nature.damping_n_s_m *= more;
    });
    const double frequency_hz = dice.chance(0.5) ? 2.4 : 3.6;
    double omega = two_pi * frequency_hz;
    if (world == World::two_well) {
      m.oscillator.natural_frequency_hz = physics::Parameter{2.4, 0.0};
      omega = two_pi * 2.4;
      const double linear = dice.uniform(12.0, 32.0);
      const double at_m = dice.uniform(0.009, 0.012);
      const Known a = known(linear, 0.04 * linear, dice);
      const Known b = known(linear / (at_m * at_m), 0.05 * linear / (at_m * at_m), dice);
      m.oscillator.two_well = physics::TwoWell{a.declared, b.declared};
      n.well_linear_n_m = a.truth;
      n.well_cubic_n_m3 = b.truth;
      rig.shifts.emplace_back(
          [sigma = a.declared.sigma](Nature& nature) { nature.well_linear_n_m += sigma; });
      rig.shifts.emplace_back(
          [sigma = b.declared.sigma](Nature& nature) { nature.well_cubic_n_m3 += sigma; });
    } else if (world == World::force && dice.chance(0.5)) {
      const double stiffness = mass_kg * omega * omega;
      const Known k = known(stiffness, 0.04 * stiffness, dice);
      m.oscillator.stiffness_n_m = k.declared;
      n.stiffness_n_m = k.truth;
      rig.shifts.emplace_back(
          [sigma = k.declared.sigma](Nature& nature) { nature.stiffness_n_m += sigma; });
    } else {
      const Known f = known(frequency_hz, 0.05, dice);
      m.oscillator.natural_frequency_hz = f.declared;
      omega = two_pi * f.truth;
      n.stiffness_n_m = n.mass_kg * omega * omega;
      rig.shifts.emplace_back([more = 1.0 + f.declared.sigma / f.truth](Nature& nature) {
        nature.stiffness_n_m *= more * more;
        nature.damping_n_s_m *= more;
      });
    }
    const double ratio = world == World::force ? 0.03 : 0.015;
    if (m.oscillator.stiffness_n_m) {
      const double damping = 2.0 * ratio * mass_kg * omega;
      const Known c = known(damping, 0.25 * damping, dice);
      m.oscillator.damping_n_s_m = c.declared;
      n.damping_n_s_m = std::max(c.truth, 0.1 * damping);
      rig.shifts.emplace_back(
          [sigma = c.declared.sigma](Nature& nature) { nature.damping_n_s_m += sigma; });
    } else {
      const Known zeta = known(ratio, 0.005, dice);
      m.oscillator.damping_ratio = zeta.declared;
      n.damping_n_s_m = 2.0 * std::max(zeta.truth, 0.002) * n.mass_kg * omega;
      rig.shifts.emplace_back([more = 2.0 * zeta.declared.sigma * n.mass_kg *
                                      omega](Nature& nature) { nature.damping_n_s_m += more; });
    }
  }

  const bool wedge = world == World::skewed || world == World::motivational;
  if (world == World::force) {
    n.loaded = false;
  } else {
    physics::NormalLoad load;
    load.law = wedge ? physics::NormalLoadLaw::wedge : physics::NormalLoadLaw::constant;
    const double newtons = wedge ? dice.uniform(0.12, 0.35) : dice.uniform(0.1, 0.27);
    const Known value = known(newtons, newtons < 0.2 ? 0.01 : 0.015, dice);
    load.load_n = value.declared;
    n.load_n = value.truth;
    rig.shifts.emplace_back(
        [sigma = value.declared.sigma](Nature& nature) { nature.load_n += sigma; });
    if (wedge) {
      const double slope = dice.uniform(180.0, 320.0);
      const Known s = known(slope, 0.08 * slope, dice);
      load.slope_per_m = s.declared;
      n.load_slope_per_m = s.truth;
      rig.shifts.emplace_back(
          [sigma = s.declared.sigma](Nature& nature) { nature.load_slope_per_m += sigma; });
    }
    m.normal_load = load;
  }

  if (world == World::force && wishes.lacks_friction) {
    m.friction.law = physics::FrictionLaw::none;
    n.friction = false;
  } else {
    m.friction.law = physics::FrictionLaw::coulomb;
    const bool in_newtons = !n.loaded;
    const double mu = in_newtons ? dice.uniform(0.004, 0.012) : dice.uniform(0.3, 0.8);
    const Known coefficient = known(mu, in_newtons ? 0.15 * mu : (mu > 0.5 ? 0.1 : 0.05), dice);
    m.friction.mu = coefficient.declared;
    n.mu = coefficient.truth;
    rig.shifts.emplace_back(
        [sigma = coefficient.declared.sigma](Nature& nature) { nature.mu += sigma; });
    n.transition_speed_m_s = wishes.set_valued ? 0.0 : rounded(dice.uniform(0.0014, 0.004), 3);
    m.friction.transition_speed_m_s = {n.transition_speed_m_s, 0.0};
    if (wishes.relaxes) {
      m.friction.law = physics::FrictionLaw::state_variable;
      const double rate = dice.uniform(90.0, 250.0);
      const Known gamma = known(rate, 0.15 * rate, dice);
      m.friction.rate_per_s = gamma.declared;
      n.relaxation_per_s = gamma.truth;
      rig.shifts.emplace_back(
          [sigma = gamma.declared.sigma](Nature& nature) { nature.relaxation_per_s += sigma; });
    }
  }

  const bool has_cell =
      world == World::regular || world == World::skewed || world == World::two_well;
  if (has_cell) {
    physics::LoadCell cell;
    cell.dynamics = wishes.rings ? physics::LoadCellDynamics::resonant
                                 : physics::LoadCellDynamics::quasi_static;
    const Known mass = known(0.0126, 0.0001, dice);
    const Known frequency = known(19.3, 0.2, dice);
    const Known ratio = known(0.016, 0.003, dice);
    const bool exact = dice.chance(0.5);
    const auto believed = [exact](const Known& each) {
      return exact ? physics::Parameter{each.declared.value, 0.0} : each.declared;
    };
    const auto real = [exact](const Known& each) {
      return exact ? each.declared.value : each.truth;
    };
    cell.mass_kg = believed(mass);
    cell.natural_frequency_hz = believed(frequency);
    cell.damping_ratio = believed(ratio);
    n.cell = true;
    n.cell_rings = wishes.rings;
    n.cell_mass_kg = real(mass);
    n.cell_frequency_hz = real(frequency);
    n.cell_damping_ratio = std::max(real(ratio), 0.004);
    m.load_cell = cell;
    if (!exact) {
      rig.shifts.emplace_back(
          [sigma = mass.declared.sigma](Nature& nature) { nature.cell_mass_kg += sigma; });
      rig.shifts.emplace_back([sigma = frequency.declared.sigma](Nature& nature) {
        nature.cell_frequency_hz += sigma;
      });
      rig.shifts.emplace_back(
          [sigma = ratio.declared.sigma](Nature& nature) { nature.cell_damping_ratio += sigma; });
    }
  }

  const auto read = [&](Channel channel, std::vector<physics::Filter> filters) {
    Reading& reading = n.reading[index_of(channel)];
    reading.recorded = true;
    reading.filters = filters;
    m.sensors[index_of(channel)].filters = std::move(filters);
  };
  const bool only_displacement = world == World::force;
  read(Channel::displacement, {lowpass(4, 25.0)});
  if (!only_displacement) read(Channel::velocity, {lowpass(1, 150.0)});
  if (has_cell || world == World::imposed) read(Channel::friction_force, {lowpass(4, 100.0)});
  if (m.normal_load) read(Channel::normal_load, {lowpass(4, 100.0)});
  if (n.excitation == physics::Excitation::base) {
    read(Channel::base_displacement, {lowpass(4, 25.0)});
  }
  if (n.excitation == physics::Excitation::force) read(Channel::drive_force, {});
  n.drive = draw_drive(world, n, dice);
  return rig;
}

}  // namespace stickslip::concealment
