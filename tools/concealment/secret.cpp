#include "tools/concealment/secret.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <stdexcept>

namespace stickslip::concealment {

namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

// clang-format off
constexpr std::array anywhere_forced = {World::regular, World::skewed, World::two_well, World::motivational, World::force};
constexpr std::array with_friction = {World::regular, World::skewed, World::motivational, World::imposed};
constexpr std::array with_force_channel = {World::regular, World::skewed, World::imposed};
constexpr std::array flat_plates = {World::regular, World::imposed};
constexpr std::array single_well = {World::regular, World::skewed, World::motivational, World::force};
constexpr std::array free_spring = {World::regular, World::skewed, World::force};
constexpr std::array only_force = {World::force};
constexpr std::array only_regular = {World::regular};
constexpr std::array only_skewed = {World::skewed};
constexpr std::array with_cell = {World::regular, World::skewed};
constexpr std::array with_velocity = {World::regular, World::skewed, World::two_well, World::motivational};

constexpr Wishes plain{};
constexpr Wishes frictionless{.lacks_friction = true};
constexpr Wishes quasi_static{.rings = false};
constexpr Wishes set_valued{.set_valued = true};

const std::array secrets = {
    Secret{"dry_friction", true, only_force, frictionless},
    Secret{"friction_memory", true, with_friction, plain, false},
    Secret{"stribeck", true, with_friction, plain},
    Secret{"dwell_strengthening", true, with_force_channel, set_valued},
    Secret{"contact_compliance", true, with_force_channel, plain},
    Secret{"load_dependent_mu", true, only_skewed, plain},
    Secret{"asymmetric_friction", true, with_friction, plain},
    Secret{"position_dependent_mu", true, flat_plates, plain},
    Secret{"friction_drift", true, with_friction, plain},
    Secret{"quadratic_drag", true, only_force, frictionless},
    Secret{"cubic_stiffness", true, single_well, plain},
    Secret{"hysteresis", true, only_force, frictionless},
    Secret{"end_stop", true, free_spring, plain},
    Secret{"bias_force", true, single_well, plain},
    Secret{"ambient_vibration", true, anywhere_forced, plain},
    Secret{"second_mode", true, with_cell, plain},
    Secret{"wedge_load", true, only_regular, plain},
    Secret{"load_cell_resonance", true, with_cell, quasi_static, false},
    Secret{"differentiator_lag", true, with_velocity, plain, false},
    Secret{"channel_delay", true, with_velocity, plain},
    Secret{"gain_error", true, with_velocity, plain},
    Secret{"crosstalk", true, with_velocity, plain},
    Secret{"clipping", true, with_velocity, plain},
    Secret{"mains_hum", true, with_velocity, plain},
    Secret{"sensor_drift", true, with_velocity, plain},
    Secret{"rippled_track", false, flat_plates, plain},
    Secret{"even_spring", false, free_spring, plain},
    Secret{"viscous_contact", false, with_force_channel, plain},
    Secret{"damping_growing_with_deflection", false, free_spring, plain},
    Secret{"magnet_beside_the_track", false, free_spring, plain},
    Secret{"passing_friction", false, with_friction, plain},
    Secret{"passing_force", false, free_spring, plain},
};
// clang-format on

std::string text(const char* format, double value) {
  char line[160];
  std::snprintf(line, sizeof line, format, value);
  return line;
}

// A channel that a fault of the reading can sit in: one that the models predict from others.
Channel faulty_channel(const Rig& rig, Dice& dice) {
  std::vector<Channel> choices = {Channel::velocity};
  if (rig.nature.reading[index_of(Channel::friction_force)].recorded) {
    choices.push_back(Channel::friction_force);
    choices.push_back(Channel::friction_force);
  }
  choices.push_back(Channel::displacement);
  return choices[dice.pick(choices.size())];
}

}  // namespace

std::span<const Secret> all_secrets() { return secrets; }

const Secret* secret_named(std::string_view id) {
  const auto found =
      std::find_if(secrets.begin(), secrets.end(), [&](const Secret& s) { return s.id == id; });
  return found == secrets.end() ? nullptr : &*found;
}

TrueEffect hide(const Secret& secret, double strength, const Sizes& sizes, Rig& rig, Dice dice) {
  Nature& n = rig.nature;
  const std::string_view id = secret.id;
  const double x = sizes.displacement_m;
  const double v = sizes.velocity_m_s;
  const double friction_n = n.mu * (n.loaded ? n.load_n : 1.0);
  TrueEffect e;
  e.id = secret.listed ? std::string(id) : "unlisted";
  if (!secret.listed) e.physics = id;
  e.accept = {e.id};
  e.form = "as the catalogue";
  const auto relation = [&](const char* name) { e.relations = {name}; };
  const auto parameter = [&](const char* name, double value, double tolerance,
                             double reference = 0.0) -> TrueParameter& {
    return e.parameters[name] = TrueParameter{value, tolerance, reference, true, false};
  };

  if (id == "dry_friction") {
    relation("friction_law");
    n.friction = true;
    n.mu = strength * 0.1 * n.stiffness_n_m * x;
    n.transition_speed_m_s = dice.chance(0.5) ? 0.0 : 0.01 * v;
    e.form = n.transition_speed_m_s > 0.0 ? "tanh" : "set-valued";
    parameter("friction_force_n", n.mu, 0.25);
  } else if (id == "friction_memory") {
    relation("friction_law");
    n.relaxation_per_s = dice.log_uniform(60.0, 300.0);
    if (dice.chance(0.5)) {
      n.relaxation_spread = 0.4;
      e.form = "two relaxation processes (1.4 and 0.6 gamma, 70:30), mean lag 1/gamma";
    }
    parameter("gamma_per_s", n.relaxation_per_s, 0.3);
  } else if (id == "stribeck") {
    relation("friction_law");
    n.static_ratio = 1.0 + std::min(0.15 * strength, 1.0);
    n.stribeck_speed_m_s = v * dice.log_uniform(0.03, 0.2);
    n.stribeck_power = dice.uniform(1.0, 2.0);
    e.form = text("exponential of the speed to the power %.3f", n.stribeck_power);
    parameter("static_ratio", n.static_ratio, 0.4, 1.0);
    parameter("stribeck_speed_m_s", n.stribeck_speed_m_s, 0.6);
  } else if (id == "dwell_strengthening") {
    relation("friction_law");
    n.ageing_beta = std::min(0.08 * strength, 0.6);
    n.ageing_tau_s = dice.log_uniform(0.003, 0.03);
    n.ageing_slip_m = x * dice.log_uniform(0.003, 0.02);
    e.form = text("Dieterich ageing, slip length %.3g m", n.ageing_slip_m);
    parameter("beta", n.ageing_beta, 0.5);
    parameter("tau_s", n.ageing_tau_s, 1.0).graded = false;
  } else if (id == "contact_compliance") {
    relation("friction_law");
    n.bristle_n_m = friction_n / std::clamp(3.0e-4 * strength, 5.0e-5, 1.5e-3);
    n.bristle_n_s_m = 0.15 * std::sqrt(n.bristle_n_m * 0.0126) * dice.uniform(0.3, 1.0);
    n.bristle_elastic_share = dice.chance(0.5) ? dice.uniform(0.2, 0.7) : 0.0;
    e.form = text("elasto-plastic bristle, elastic to %.3f of break-away", n.bristle_elastic_share);
    parameter("contact_stiffness_n_m", n.bristle_n_m, 0.35);
  } else if (id == "load_dependent_mu") {
    relation("friction_law");
    n.load_exponent = dice.sign() * std::min(0.1 * strength, 0.6);
    parameter("exponent", n.load_exponent, 0.3);
  } else if (id == "asymmetric_friction") {
    relation("friction_law");
    n.asymmetry = dice.sign() * std::min(0.08 * strength, 0.7);
    parameter("asymmetry", n.asymmetry, 0.25);
  } else if (id == "position_dependent_mu") {
    relation("friction_law");
    n.mu_slope_per_m = dice.sign() * std::min(0.15 * strength, 0.8) / x;
    if (dice.chance(0.5)) {
      n.mu_saturates_m = x * dice.uniform(1.0, 3.0);
      e.form = text("saturating along the track, length %.3g m", n.mu_saturates_m);
    }
    parameter("slope_per_m", n.mu_slope_per_m, 0.3);
  } else if (id == "friction_drift") {
    relation("friction_law");
    n.mu_drift_per_s = dice.sign() * std::min(0.2 * strength, 0.8) / sizes.duration_s;
    if (dice.chance(0.5)) {
      n.mu_settles_s = sizes.duration_s * dice.uniform(0.25, 1.0);
      e.form = text("exponential approach, time constant %.2f s", n.mu_settles_s);
    }
    parameter("rate_per_s", n.mu_drift_per_s, 0.3).graded = n.mu_settles_s == 0.0;
  } else if (id == "quadratic_drag") {
    relation("force_balance");
    n.drag_power = dice.uniform(1.9, 2.1);
    n.drag = strength * 0.05 * n.stiffness_n_m * x / (v * v);
    e.form = text("power %.2f of the speed", n.drag_power);
    parameter("drag_n_s2_m2", n.drag, 0.3);
  } else if (id == "cubic_stiffness") {
    relation("force_balance");
    const bool hardens = dice.chance(0.6);
    const double share = hardens ? 0.15 * strength : -std::min(0.15 * strength, 0.35);
    n.cubic_n_m3 = share * n.stiffness_n_m / (x * x);
    e.form = "cubic";
    if (hardens && dice.chance(0.5)) {
      n.sinh_length_m = x * dice.uniform(0.8, 1.5);
      e.form = "sinh spring with this cubic coefficient";
    }
    parameter("k3_n_m3", n.cubic_n_m3, 0.25);
  } else if (id == "hysteresis") {
    relation("force_balance");
    n.iwan_n_m = std::min(0.2 * strength, 1.5) * n.stiffness_n_m;
    n.iwan_slip_n = n.iwan_n_m * x * dice.uniform(0.15, 0.45);
    e.form = "five Iwan elements";
    parameter("stiffness_n_m", n.iwan_n_m, 0.5);
    parameter("slip_force_n", n.iwan_slip_n, 0.5);
  } else if (id == "end_stop") {
    relation("force_balance");
    n.stop_gap_m = x * dice.uniform(0.55, 0.85);
    n.stop_side = dice.chance(0.5) ? 0 : (dice.chance(0.5) ? 1 : -1);
    const double linear = 1.5 * strength * n.stiffness_n_m;
    const bool hertz = dice.chance(0.4);
    n.stop_power = hertz ? 1.5 : 1.0;
    n.stop_stiffness = hertz ? linear / std::sqrt(0.3 * x) : linear;
    e.form = std::string(n.stop_side == 0 ? "both sides" : "one side") +
             (hertz ? ", Hertz contact" : ", linear");
    parameter("gap_m", n.stop_gap_m, 0.1);
    parameter("stiffness_n_m", linear, 0.6).graded = !hertz;
  } else if (id == "bias_force") {
    relation("force_balance");
    n.bias_n = dice.sign() * strength * 0.03 * std::max(friction_n, 0.3 * n.stiffness_n_m * x);
    parameter("force_n", n.bias_n, 0.25).sign_free = true;
  } else if (id == "ambient_vibration") {
    relation("force_balance");
    n.ambient_hz = dice.uniform(5.0, 18.0);
    const double omega = two_pi * n.ambient_hz;
    n.ambient_n = strength * 0.01 * x * n.mass_kg * omega * omega;
    n.ambient_phase_rad = dice.uniform(0.0, two_pi);
    parameter("frequency_hz", n.ambient_hz, 0.02);
    parameter("amplitude_n", n.ambient_n, 0.3);
  } else if (id == "second_mode") {
    relation("force_balance");
    n.mode_hz = dice.uniform(28.0, 45.0);
    n.mode_damping_ratio = dice.log_uniform(0.005, 0.03);
    const double omega = two_pi * n.mode_hz;
    n.mode_friction_per_kg = strength * 0.03 * x * omega * omega / std::max(friction_n, 1.0e-3);
    n.mode_base_share = dice.uniform(0.0, 0.3);
    parameter("frequency_hz", n.mode_hz, 0.03);
  } else if (id == "wedge_load") {
    relation("normal_load");
    n.load_slope_per_m = dice.sign() * std::min(0.06 * strength, 0.7) / x;
    if (dice.chance(0.5)) {
      n.load_curvature_per_m2 = n.load_slope_per_m / x * dice.uniform(-0.3, 0.3);
      e.form = text("bowed plates, curvature %.2f 1/m2", n.load_curvature_per_m2);
    }
    parameter("slope_per_m", n.load_slope_per_m, 0.2);
  } else if (id == "load_cell_resonance") {
    relation("load_cell");
    n.cell_rings = true;
    parameter("frequency_hz", n.cell_frequency_hz, 0.03);
    parameter("damping_ratio", n.cell_damping_ratio, 0.6);
  } else if (id == "differentiator_lag") {
    relation("kinematics");
    n.differentiator_hz = dice.log_uniform(15.0, 60.0);
    parameter("cutoff_hz", n.differentiator_hz, 0.25);
  } else if (id == "rippled_track") {
    relation("friction_law");
    e.depends_on = {"displacement"};
    n.ripple = std::min(0.2 * strength, 0.7);
    n.ripple_length_m = x * dice.uniform(0.35, 1.0);
    n.ripple_phase_rad = dice.uniform(0.0, two_pi);
    e.form = text("friction periodic along the track, %.4f", n.ripple) +
             text(", wavelength %.4g m", n.ripple_length_m);
  } else if (id == "even_spring") {
    relation("force_balance");
    e.depends_on = {"displacement"};
    n.quadratic_n_m2 = dice.sign() * std::min(0.1 * strength, 0.4) * n.stiffness_n_m / x;
    e.form = text("even spring x^2, %.2f N/m2", n.quadratic_n_m2);
  } else if (id == "viscous_contact") {
    relation("friction_law");
    e.depends_on = {"velocity"};
    n.contact_viscosity_n_s_m = strength * 0.15 * friction_n / v;
    e.form = text("viscous friction in the contact, %.4g N s/m", n.contact_viscosity_n_s_m);
  } else if (id == "damping_growing_with_deflection") {
    relation("force_balance");
    e.depends_on = {"displacement", "velocity"};
    n.position_damping_n_s_m3 = strength * 0.3 * n.stiffness_n_m / (x * v);
    e.form = text("damping c x^2 v, %.4g N s/m3", n.position_damping_n_s_m3);
  } else if (id == "magnet_beside_the_track") {
    relation("force_balance");
    e.depends_on = {"displacement"};
    n.bump_n = dice.sign() * std::min(0.06 * strength, 0.4) * n.stiffness_n_m * x;
    n.bump_at_m = x * dice.uniform(-0.5, 0.5);
    n.bump_width_m = x * dice.uniform(0.1, 0.25);
    e.form = text("a magnet %.4g m from the middle", n.bump_at_m);
  } else if (id == "passing_friction" || id == "passing_force") {
    e.depends_on = {"time"};
    const double from = sizes.duration_s * dice.uniform(0.15, 0.5);
    n.event = {from, from + sizes.duration_s * dice.uniform(0.15, 0.35)};
    e.when_s = {{n.event.from_s, n.event.to_s}};
    if (id == "passing_friction") {
      relation("friction_law");
      n.event_friction = dice.chance(0.5) ? 0.2 * strength : -std::min(0.2 * strength, 0.8);
      e.form = text("friction changed by %.3f of itself for a while", n.event_friction);
    } else {
      relation("force_balance");
      n.event_force_n =
          dice.sign() * strength * 0.04 * std::max(friction_n, 0.3 * n.stiffness_n_m * x);
      e.form = text("a constant force of %.4g N for a while", n.event_force_n);
    }
  } else {
    relation("sensor");
    const Channel channel = faulty_channel(rig, dice);
    e.channel = channel;
    Reading& reading = n.reading[index_of(channel)];
    const double spread = sizes.spread[index_of(channel)];
    if (id == "channel_delay") {
      reading.delay_s = std::min(0.003 * strength, 0.02);
      reading.bessel_delay = dice.chance(0.5);
      e.form = reading.bessel_delay ? "second-order Bessel filter" : "pure delay";
      parameter("delay_s", reading.delay_s, 0.25);
    } else if (id == "gain_error") {
      reading.gain = 1.0 + dice.sign() * std::min(0.05 * strength, 0.5);
      parameter("gain", reading.gain, 0.3, 1.0);
    } else if (id == "crosstalk") {
      std::vector<Channel> sources;
      for (const Channel each : {Channel::displacement, Channel::velocity, Channel::friction_force,
                                 Channel::base_displacement}) {
        if (each != channel && n.reading[index_of(each)].recorded) sources.push_back(each);
      }
      reading.leak_from = sources[dice.pick(sources.size())];
      reading.leak =
          dice.sign() * 0.04 * strength * spread / sizes.spread[index_of(reading.leak_from)];
      e.form = "from " + std::string(info(reading.leak_from).stem);
      parameter("coefficient", reading.leak, 0.3);
    } else if (id == "clipping") {
      reading.limit =
          sizes.largest[index_of(channel)] * std::clamp(1.0 - 0.15 * strength, 0.4, 0.97);
      parameter("limit", reading.limit, 0.05);
    } else if (id == "mains_hum") {
      reading.hum_hz = dice.chance(0.7) ? 50.0 : 60.0;
      reading.hum_amplitude = 0.05 * strength * spread;
      reading.hum_wander = dice.chance(0.5) ? dice.uniform(0.1, 0.3) : 0.0;
      e.form = text("amplitude wanders by %.4f", reading.hum_wander);
      parameter("frequency_hz", reading.hum_hz, 0.005);
      parameter("amplitude", reading.hum_amplitude, 0.35);
    } else if (id == "sensor_drift") {
      reading.drift_per_s = dice.sign() * 0.3 * strength * spread / sizes.duration_s;
      if (dice.chance(0.4)) reading.drift_settles_s = sizes.duration_s * dice.uniform(0.3, 1.0);
      e.form = reading.drift_settles_s > 0.0
                   ? text("exponential approach, time constant %.2f s", reading.drift_settles_s)
                   : "ramp";
      parameter("rate_per_s", reading.drift_per_s, 0.3).graded = reading.drift_settles_s == 0.0;
    } else {
      throw std::invalid_argument("nobody knows how to hide " + std::string(id));
    }
  }
  return e;
}

}  // namespace stickslip::concealment
