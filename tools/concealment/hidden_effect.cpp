// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/hidden_effect.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace stickslip::concealment {

struct EffectDraw {
  ReferenceRig& rig;
  const Sizes& sizes;
  double strength;
  RandomSource random;
  double x;           ///< largest displacement [m]
  double v;           ///< largest velocity [m/s]
  double friction_n;  ///< before the effect was added
  TrueEffect effect;

  void relation(const char* name) { effect.relations = {name}; }
  /// The value, the tolerance of its grading, and the value that means no effect.
  TrueParameter& parameter(const char* name, double value, double tolerance, double neutral = 0.0) {
    return effect.parameters[name] = TrueParameter{value, tolerance, neutral, true, false};
  }
  /// Standard deviation of the readings of the effect's channel.
  double spread() const { return sizes.spread[index_of(*effect.channel)]; }
};

namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

std::string text(const char* format, double value) {
  char line[160];
  std::snprintf(line, sizeof line, format, value);
  return line;
}

// Sensor errors are hidden in channels that the models predict from others.
Channel predicted_channel(const ReferenceRig& rig, RandomSource& random) {
  std::vector<Channel> choices = {Channel::velocity};
  if (rig.instrument[index_of(Channel::friction_force)].recorded) {
    choices.push_back(Channel::friction_force);
    choices.push_back(Channel::friction_force);
  }
  choices.push_back(Channel::displacement);
  return choices[random.index(choices.size())];
}

constexpr double wander_step_s = 0.1;

// An amplitude that wanders about its mean, with this standard deviation and for about `memory_s`.
Wander wander(double deviation, double memory_s, double duration_s, RandomSource& random) {
  Wander out{wander_step_s, {}};
  const double kept = std::exp(-wander_step_s / memory_s);
  double value = random.normal();
  for (double t = 0.0; t <= duration_s; t += wander_step_s) {
    out.knots.push_back(std::clamp(deviation * value, -0.8, 0.8));
    value = kept * value + std::sqrt(1.0 - kept * kept) * random.normal();
  }
  return out;
}

// A random walk from 0, with this standard deviation at its end.
Wander random_walk(double deviation, double duration_s, RandomSource& random) {
  Wander out{wander_step_s, {}};
  const double step = deviation * std::sqrt(wander_step_s / duration_s);
  double value = 0.0;
  for (double t = 0.0; t <= duration_s; t += wander_step_s) {
    out.knots.push_back(value);
    value += step * random.normal();
  }
  return out;
}

// Positive shares with the sum 1, each within 60 % of the given one before.
std::array<double, iwan_elements> drawn_shares(std::array<double, iwan_elements> shares,
                                               RandomSource& random) {
  double sum = 0.0;
  for (double& share : shares) sum += share *= random.uniform(0.4, 1.6);
  for (double& share : shares) share /= sum;
  return shares;
}

void dry_friction(EffectDraw& d) {
  d.relation("friction_law");
  d.rig.friction = true;
  d.rig.mu = d.strength * 0.1 * d.rig.stiffness_n_m * d.x;
  d.rig.transition_speed_m_s = d.random.chance(0.5) ? 0.0 : 0.01 * d.v;
  d.effect.form = d.rig.transition_speed_m_s > 0.0 ? "tanh" : "set-valued";
  d.parameter("friction_force_n", d.rig.mu, 0.25);
}

void friction_memory(EffectDraw& d) {
  d.relation("friction_law");
  d.rig.relaxation_per_s = d.random.log_uniform(60.0, 300.0);
  if (d.random.chance(0.5)) {
    d.rig.relaxation_share = d.random.uniform(0.3, 0.85);
    d.rig.relaxation_ratio = d.random.log_uniform(1.5, 5.0);
    d.effect.form = text("two relaxation processes, mean lag 1/gamma, share of the faster %.3f",
                         d.rig.relaxation_share) +
                    text(", ratio of the rates %.3f", d.rig.relaxation_ratio);
  }
  d.parameter("gamma_per_s", d.rig.relaxation_per_s, 0.3);
}

void stribeck(EffectDraw& d) {
  d.relation("friction_law");
  d.rig.static_ratio = 1.0 + std::min(0.15 * d.strength, 1.0);
  d.rig.stribeck_speed_m_s = d.v * d.random.log_uniform(0.03, 0.2);
  d.rig.stribeck_power = d.random.uniform(1.0, 2.0);
  d.effect.form = text("exponential of the speed to the power %.3f", d.rig.stribeck_power);
  d.parameter("static_ratio", d.rig.static_ratio, 0.4, 1.0);
  d.parameter("stribeck_speed_m_s", d.rig.stribeck_speed_m_s, 0.6);
}

void dwell_strengthening(EffectDraw& d) {
  d.relation("friction_law");
  d.rig.ageing_beta = std::min(0.08 * d.strength, 0.6);
  d.rig.ageing_tau_s = d.random.log_uniform(0.003, 0.03);
  d.rig.ageing_slip_m = d.x * d.random.log_uniform(0.003, 0.02);
  d.effect.form = text("Dieterich ageing, slip length %.3g m", d.rig.ageing_slip_m);
  d.parameter("beta", d.rig.ageing_beta, 0.5);
  d.parameter("tau_s", d.rig.ageing_tau_s, 1.0).graded = false;
}

void contact_compliance(EffectDraw& d) {
  d.relation("friction_law");
  d.rig.bristle_n_m = d.friction_n / std::clamp(3.0e-4 * d.strength, 5.0e-5, 1.5e-3);
  d.rig.bristle_n_s_m = 0.15 * std::sqrt(d.rig.bristle_n_m * 0.0126) * d.random.uniform(0.3, 1.0);
  switch (d.random.index(3)) {
    case 0:
      d.rig.bristle_elastic_share = d.random.chance(0.5) ? d.random.uniform(0.2, 0.7) : 0.0;
      d.effect.form = text("elasto-plastic bristle, elastic to %.3f of break-away",
                           d.rig.bristle_elastic_share);
      break;
    case 1:
      d.rig.dahl_exponent = 1.0;
      d.rig.bristle_damping_speed_m_s = d.v * d.random.log_uniform(0.02, 0.2);
      d.effect.form =
          text("LuGre bristle, damping up to %.3g m/s", d.rig.bristle_damping_speed_m_s);
      break;
    default:
      d.rig.dahl_exponent = d.random.uniform(0.6, 2.0);
      d.effect.form = text("Dahl bristle, exponent %.3f", d.rig.dahl_exponent);
      break;
  }
  d.parameter("contact_stiffness_n_m", d.rig.bristle_n_m, 0.35);
}

void load_dependent_mu(EffectDraw& d) {
  d.relation("friction_law");
  d.rig.load_exponent = d.random.sign() * std::min(0.1 * d.strength, 0.6);
  d.rig.load_logarithmic = d.random.chance(0.5);
  d.effect.form = d.rig.load_logarithmic ? "logarithm of the load" : "power of the load";
  d.parameter("exponent", d.rig.load_exponent, 0.3);
}

void asymmetric_friction(EffectDraw& d) {
  d.relation("friction_law");
  d.rig.asymmetry = d.random.sign() * std::min(0.08 * d.strength, 0.7);
  if (d.random.chance(0.5)) {
    d.rig.asymmetry_speed_m_s = d.v * d.random.log_uniform(0.01, 0.06);
    d.effect.form = text("both sides meet over %.3g m/s", d.rig.asymmetry_speed_m_s);
  }
  d.parameter("asymmetry", d.rig.asymmetry, 0.25);
}

void position_dependent_mu(EffectDraw& d) {
  d.relation("friction_law");
  d.rig.mu_slope_per_m = d.random.sign() * std::min(0.15 * d.strength, 0.8) / d.x;
  if (d.random.chance(0.5)) {
    d.rig.mu_saturation_m = d.x * d.random.uniform(1.0, 3.0);
    d.effect.form = text("saturating along the track, length %.3g m", d.rig.mu_saturation_m);
  }
  d.parameter("slope_per_m", d.rig.mu_slope_per_m, 0.3);
}

void friction_drift(EffectDraw& d) {
  d.relation("friction_law");
  d.rig.mu_drift_per_s = d.random.sign() * std::min(0.2 * d.strength, 0.8) / d.sizes.duration_s;
  if (d.random.chance(0.5)) {
    d.rig.mu_settling_s = d.sizes.duration_s * d.random.uniform(0.25, 1.0);
    d.effect.form = text("exponential approach, time constant %.2f s", d.rig.mu_settling_s);
  }
  d.parameter("rate_per_s", d.rig.mu_drift_per_s, 0.3).graded = d.rig.mu_settling_s == 0.0;
}

void quadratic_drag(EffectDraw& d) {
  d.relation("force_balance");
  d.rig.drag_power = d.random.uniform(1.9, 2.1);
  d.rig.drag = d.strength * 0.05 * d.rig.stiffness_n_m * d.x / (d.v * d.v);
  d.effect.form = text("power %.2f of the speed", d.rig.drag_power);
  d.parameter("drag_n_s2_m2", d.rig.drag, 0.3);
}

void cubic_stiffness(EffectDraw& d) {
  d.relation("force_balance");
  const bool hardens = d.random.chance(0.6);
  const double share = hardens ? 0.15 * d.strength : -std::min(0.15 * d.strength, 0.35);
  d.rig.cubic_n_m3 = share * d.rig.stiffness_n_m / (d.x * d.x);
  d.effect.form = "cubic";
  if (hardens && d.random.chance(0.5)) {
    d.rig.sinh_length_m = d.x * d.random.uniform(0.8, 1.5);
    d.effect.form = "sinh spring with this cubic coefficient";
  }
  d.parameter("k3_n_m3", d.rig.cubic_n_m3, 0.25);
}

void hysteresis(EffectDraw& d) {
  d.relation("force_balance");
  d.rig.iwan_n_m = std::min(0.2 * d.strength, 1.5) * d.rig.stiffness_n_m;
  d.rig.iwan_slip_n = d.rig.iwan_n_m * d.x * d.random.uniform(0.15, 0.45);
  d.rig.iwan_stiffness_share = drawn_shares(d.rig.iwan_stiffness_share, d.random);
  d.rig.iwan_slip_share = drawn_shares(d.rig.iwan_slip_share, d.random);
  d.effect.form = "five Iwan elements of drawn shares";
  d.parameter("stiffness_n_m", d.rig.iwan_n_m, 0.5);
  d.parameter("slip_force_n", d.rig.iwan_slip_n, 0.5);
}

void end_stop(EffectDraw& d) {
  d.relation("force_balance");
  d.rig.stop_gap_m = d.x * d.random.uniform(0.55, 0.85);
  d.rig.stop_side = d.random.chance(0.5) ? 0 : (d.random.chance(0.5) ? 1 : -1);
  const double linear = 1.5 * d.strength * d.rig.stiffness_n_m;
  const bool hertz = d.random.chance(0.4);
  d.rig.stop_power = hertz ? 1.5 : 1.0;
  d.rig.stop_stiffness = hertz ? linear / std::sqrt(0.3 * d.x) : linear;
  d.effect.form = std::string(d.rig.stop_side == 0 ? "both sides" : "one side") +
                  (hertz ? ", Hertz contact" : ", linear");
  d.parameter("gap_m", d.rig.stop_gap_m, 0.1);
  d.parameter("stiffness_n_m", linear, 0.6).graded = !hertz;
}

void bias_force(EffectDraw& d) {
  d.relation("force_balance");
  d.rig.bias_n =
      d.random.sign() * d.strength * 0.03 * std::max(d.friction_n, 0.3 * d.rig.stiffness_n_m * d.x);
  d.parameter("force_n", d.rig.bias_n, 0.25).sign_free = true;
}

void ambient_vibration(EffectDraw& d) {
  d.relation("force_balance");
  d.rig.ambient_hz = d.random.uniform(5.0, 18.0);
  const double omega = two_pi * d.rig.ambient_hz;
  d.rig.ambient_n = d.strength * 0.01 * d.x * d.rig.mass_kg * omega * omega;
  d.rig.ambient_phase_rad = d.random.uniform(0.0, two_pi);
  if (d.random.chance(0.5)) {
    d.rig.ambient_harmonic = d.random.uniform(0.1, 0.3);
    d.effect.form = text("with a second harmonic of %.3f", d.rig.ambient_harmonic);
  }
  d.parameter("frequency_hz", d.rig.ambient_hz, 0.02);
  d.parameter("amplitude_n", d.rig.ambient_n, 0.3);
}

void second_mode(EffectDraw& d) {
  d.relation("force_balance");
  d.rig.mode_hz = d.random.uniform(28.0, 45.0);
  d.rig.mode_damping_ratio = d.random.log_uniform(0.005, 0.03);
  const double omega = two_pi * d.rig.mode_hz;
  d.rig.mode_friction_per_kg =
      d.strength * 0.03 * d.x * omega * omega / std::max(d.friction_n, 1.0e-3);
  d.rig.mode_base_share = d.random.uniform(0.0, 0.3);
  d.parameter("frequency_hz", d.rig.mode_hz, 0.03);
}

void wedge_load(EffectDraw& d) {
  d.relation("normal_load");
  d.rig.load_slope_per_m = d.random.sign() * std::min(0.06 * d.strength, 0.7) / d.x;
  if (d.random.chance(0.5)) {
    d.rig.load_curvature_per_m2 = d.rig.load_slope_per_m / d.x * d.random.uniform(-0.3, 0.3);
    d.effect.form = text("bowed plates, curvature %.2f 1/m2", d.rig.load_curvature_per_m2);
  }
  d.parameter("slope_per_m", d.rig.load_slope_per_m, 0.2);
}

void load_cell_resonance(EffectDraw& d) {
  d.relation("load_cell");
  d.rig.cell_rings = true;
  d.parameter("frequency_hz", d.rig.cell_frequency_hz, 0.03);
  d.parameter("damping_ratio", d.rig.cell_damping_ratio, 0.6);
}

void differentiator_lag(EffectDraw& d) {
  d.relation("kinematics");
  d.rig.differentiator_hz = d.random.log_uniform(15.0, 60.0);
  d.parameter("cutoff_hz", d.rig.differentiator_hz, 0.25);
}

void rippled_track(EffectDraw& d) {
  d.relation("friction_law");
  d.effect.depends_on = {"displacement"};
  d.rig.ripple = std::min(0.2 * d.strength, 0.7);
  d.rig.ripple_length_m = d.x * d.random.uniform(0.35, 1.0);
  d.rig.ripple_phase_rad = d.random.uniform(0.0, two_pi);
  d.effect.form = text("friction periodic along the track, %.4f", d.rig.ripple) +
                  text(", wavelength %.4g m", d.rig.ripple_length_m);
}

void even_spring(EffectDraw& d) {
  d.relation("force_balance");
  d.effect.depends_on = {"displacement"};
  d.rig.quadratic_n_m2 =
      d.random.sign() * std::min(0.1 * d.strength, 0.4) * d.rig.stiffness_n_m / d.x;
  d.effect.form = text("quadratic spring force, %.2f N/m2", d.rig.quadratic_n_m2);
}

void viscous_contact(EffectDraw& d) {
  d.relation("friction_law");
  d.effect.depends_on = {"velocity"};
  d.rig.contact_viscosity_n_s_m = d.strength * 0.15 * d.friction_n / d.v;
  d.effect.form =
      text("viscous friction in the contact, %.4g N s/m", d.rig.contact_viscosity_n_s_m);
}

void damping_growing_with_deflection(EffectDraw& d) {
  d.relation("force_balance");
  d.effect.depends_on = {"displacement", "velocity"};
  d.rig.position_damping_n_s_m3 = d.strength * 0.3 * d.rig.stiffness_n_m / (d.x * d.v);
  d.effect.form = text("damping c x^2 v, %.4g N s/m3", d.rig.position_damping_n_s_m3);
}

void magnet_beside_the_track(EffectDraw& d) {
  d.relation("force_balance");
  d.effect.depends_on = {"displacement"};
  d.rig.bump_n = d.random.sign() * std::min(0.06 * d.strength, 0.4) * d.rig.stiffness_n_m * d.x;
  d.rig.bump_at_m = d.x * d.random.uniform(-0.5, 0.5);
  d.rig.bump_width_m = d.x * d.random.uniform(0.1, 0.25);
  d.effect.form = text("a magnet %.4g m from the middle", d.rig.bump_at_m);
}

void draw_event(EffectDraw& d) {
  d.effect.depends_on = {"time"};
  const double from = d.sizes.duration_s * d.random.uniform(0.15, 0.5);
  d.rig.event = {from, from + d.sizes.duration_s * d.random.uniform(0.15, 0.35)};
  d.effect.when_s = {{d.rig.event.from_s, d.rig.event.to_s}};
}

void passing_friction(EffectDraw& d) {
  draw_event(d);
  d.relation("friction_law");
  d.rig.event_friction = d.random.chance(0.5) ? 0.2 * d.strength : -std::min(0.2 * d.strength, 0.8);
  d.effect.form = text("friction temporarily changed by %.1f %%", 100.0 * d.rig.event_friction);
}

void passing_force(EffectDraw& d) {
  draw_event(d);
  d.relation("force_balance");
  d.rig.event_force_n =
      d.random.sign() * d.strength * 0.04 * std::max(d.friction_n, 0.3 * d.rig.stiffness_n_m * d.x);
  d.effect.form = text("a temporary constant force of %.4g N", d.rig.event_force_n);
}

// Its errors come on top of those that a sound instrument has.
Instrument& draw_instrument(EffectDraw& d) {
  d.relation("sensor");
  d.effect.channel = predicted_channel(d.rig, d.random);
  return d.rig.instrument[index_of(*d.effect.channel)];
}

void channel_delay(EffectDraw& d) {
  Instrument& instrument = draw_instrument(d);
  instrument.delay_s += std::min(0.003 * d.strength, 0.02);
  instrument.bessel_delay = d.random.chance(0.5);
  d.effect.form = instrument.bessel_delay ? "second-order Bessel filter" : "pure delay";
  d.parameter("delay_s", instrument.delay_s, 0.25);
}

void gain_error(EffectDraw& d) {
  Instrument& instrument = draw_instrument(d);
  instrument.gain *= 1.0 + d.random.sign() * std::min(0.05 * d.strength, 0.5);
  d.parameter("gain", instrument.gain, 0.3, 1.0);
}

void sensor_offset(EffectDraw& d) {
  Instrument& instrument = draw_instrument(d);
  instrument.offset += d.random.sign() * std::min(0.1 * d.strength, 0.8) * d.spread();
  d.parameter("offset", instrument.offset, 0.3);
}

void crosstalk(EffectDraw& d) {
  Instrument& instrument = draw_instrument(d);
  std::vector<Channel> sources;
  for (const Channel each : {Channel::displacement, Channel::velocity, Channel::friction_force,
                             Channel::base_displacement}) {
    if (each != *d.effect.channel && d.rig.instrument[index_of(each)].recorded)
      sources.push_back(each);
  }
  instrument.crosstalk_from = sources[d.random.index(sources.size())];
  instrument.crosstalk = d.random.sign() * 0.04 * d.strength * d.spread() /
                         d.sizes.spread[index_of(instrument.crosstalk_from)];
  d.effect.form = "from " + std::string(info(instrument.crosstalk_from).stem);
  d.parameter("coefficient", instrument.crosstalk, 0.3);
}

void clipping(EffectDraw& d) {
  Instrument& instrument = draw_instrument(d);
  instrument.limit =
      d.sizes.largest[index_of(*d.effect.channel)] * std::clamp(1.0 - 0.15 * d.strength, 0.4, 0.97);
  d.parameter("limit", instrument.limit, 0.05);
}

void mains_hum(EffectDraw& d) {
  Instrument& instrument = draw_instrument(d);
  instrument.hum_hz = d.random.chance(0.7) ? 50.0 : 60.0;
  instrument.hum_amplitude = 0.05 * d.strength * d.spread();
  if (d.random.chance(0.5)) {
    const double deviation = d.random.uniform(0.1, 0.3);
    instrument.hum_wander =
        wander(deviation, d.random.uniform(2.0, 8.0), d.sizes.duration_s, d.random);
    d.effect.form = text("amplitude wanders at random by %.3f", deviation);
  }
  d.parameter("frequency_hz", instrument.hum_hz, 0.005);
  d.parameter("amplitude", instrument.hum_amplitude, 0.35);
}

void sensor_drift(EffectDraw& d) {
  Instrument& instrument = draw_instrument(d);
  instrument.drift_per_s = d.random.sign() * 0.3 * d.strength * d.spread() / d.sizes.duration_s;
  if (d.random.chance(0.4))
    instrument.drift_settling_s = d.sizes.duration_s * d.random.uniform(0.3, 1.0);
  d.effect.form =
      instrument.drift_settling_s > 0.0
          ? text("exponential approach, time constant %.2f s", instrument.drift_settling_s)
          : "ramp";
  if (d.random.chance(0.5)) {
    const double share = d.random.uniform(0.04, 0.12);
    const double drift = std::abs(instrument.drift_per_s) * d.sizes.duration_s;
    instrument.drift_wander = random_walk(share * drift, d.sizes.duration_s, d.random);
    d.effect.form += text(", and a random walk of %.3f of it", share);
  }
  d.parameter("rate_per_s", instrument.drift_per_s, 0.3).graded =
      instrument.drift_settling_s == 0.0;
}

// clang-format off
constexpr std::array anywhere_forced = {BenchKind::regular, BenchKind::skewed, BenchKind::two_well, BenchKind::motivational, BenchKind::force};
constexpr std::array with_friction = {BenchKind::regular, BenchKind::skewed, BenchKind::motivational, BenchKind::imposed};
constexpr std::array with_force_channel = {BenchKind::regular, BenchKind::skewed, BenchKind::imposed};
constexpr std::array flat_plates = {BenchKind::regular, BenchKind::imposed};
constexpr std::array single_well = {BenchKind::regular, BenchKind::skewed, BenchKind::motivational, BenchKind::force};
constexpr std::array free_spring = {BenchKind::regular, BenchKind::skewed, BenchKind::force};
constexpr std::array only_force = {BenchKind::force};
constexpr std::array only_regular = {BenchKind::regular};
constexpr std::array only_skewed = {BenchKind::skewed};
constexpr std::array with_cell = {BenchKind::regular, BenchKind::skewed};
constexpr std::array with_velocity = {BenchKind::regular, BenchKind::skewed, BenchKind::two_well, BenchKind::motivational};

constexpr BenchRequirements plain{};
constexpr BenchRequirements frictionless{.lacks_friction = true};
constexpr BenchRequirements quasi_static{.rings = false};
constexpr BenchRequirements set_valued{.set_valued = true};

const std::array effects = {
    HiddenEffect{"dry_friction", true, only_force, frictionless, dry_friction},
    HiddenEffect{"friction_memory", true, with_friction, plain, friction_memory, false},
    HiddenEffect{"stribeck", true, with_friction, plain, stribeck},
    HiddenEffect{"dwell_strengthening", true, with_force_channel, set_valued, dwell_strengthening},
    HiddenEffect{"contact_compliance", true, with_force_channel, plain, contact_compliance},
    HiddenEffect{"load_dependent_mu", true, only_skewed, plain, load_dependent_mu},
    HiddenEffect{"asymmetric_friction", true, with_friction, plain, asymmetric_friction},
    HiddenEffect{"position_dependent_mu", true, flat_plates, plain, position_dependent_mu},
    HiddenEffect{"friction_drift", true, with_friction, plain, friction_drift},
    HiddenEffect{"quadratic_drag", true, only_force, frictionless, quadratic_drag},
    HiddenEffect{"cubic_stiffness", true, single_well, plain, cubic_stiffness},
    HiddenEffect{"hysteresis", true, only_force, frictionless, hysteresis},
    HiddenEffect{"end_stop", true, free_spring, plain, end_stop},
    HiddenEffect{"bias_force", true, single_well, plain, bias_force},
    HiddenEffect{"ambient_vibration", true, anywhere_forced, plain, ambient_vibration},
    HiddenEffect{"second_mode", true, with_cell, plain, second_mode},
    HiddenEffect{"wedge_load", true, only_regular, plain, wedge_load},
    HiddenEffect{"load_cell_resonance", true, with_cell, quasi_static, load_cell_resonance, false},
    HiddenEffect{"differentiator_lag", true, with_velocity, plain, differentiator_lag, false},
    HiddenEffect{"channel_delay", true, with_velocity, plain, channel_delay},
    HiddenEffect{"gain_error", true, with_velocity, plain, gain_error},
    HiddenEffect{"crosstalk", true, with_velocity, plain, crosstalk},
    HiddenEffect{"clipping", true, with_velocity, plain, clipping},
    HiddenEffect{"mains_hum", true, with_velocity, plain, mains_hum},
    HiddenEffect{"sensor_offset", true, with_velocity, plain, sensor_offset},
    HiddenEffect{"sensor_drift", true, with_velocity, plain, sensor_drift},
    HiddenEffect{"rippled_track", false, flat_plates, plain, rippled_track},
    HiddenEffect{"even_spring", false, free_spring, plain, even_spring},
    HiddenEffect{"viscous_contact", false, with_force_channel, plain, viscous_contact},
    HiddenEffect{"damping_growing_with_deflection", false, free_spring, plain, damping_growing_with_deflection},
    HiddenEffect{"magnet_beside_the_track", false, free_spring, plain, magnet_beside_the_track},
    HiddenEffect{"passing_friction", false, with_friction, plain, passing_friction},
    HiddenEffect{"passing_force", false, free_spring, plain, passing_force},
};
// clang-format on

}  // namespace

std::span<const HiddenEffect> hidden_effects() { return effects; }

const HiddenEffect* find_hidden_effect(std::string_view id) {
  const auto found = std::find_if(effects.begin(), effects.end(),
                                  [&](const HiddenEffect& each) { return each.id == id; });
  return found == effects.end() ? nullptr : &*found;
}

TrueEffect hide(const HiddenEffect& effect, double strength, const Sizes& sizes, Bench& bench,
                RandomSource random) {
  ReferenceRig& rig = bench.rig;
  EffectDraw draw{rig,
                  sizes,
                  strength,
                  random,
                  sizes.displacement_m,
                  sizes.velocity_m_s,
                  rig.mu * (rig.loaded ? rig.load_n : 1.0),
                  {}};
  draw.effect.id = effect.listed ? std::string(effect.id) : "unlisted";
  if (!effect.listed) draw.effect.physics = effect.id;
  draw.effect.accept = {draw.effect.id};
  draw.effect.form = "as the catalogue";
  effect.draw(draw);
  return draw.effect;
}

}  // namespace stickslip::concealment
