// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/reference_simulator.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stickslip::concealment {

namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;
constexpr double h = reference_step_s;

double square(double value) { return value * value; }
double sign_of(double value) { return value > 0.0 ? 1.0 : (value < 0.0 ? -1.0 : 0.0); }

// The root of an increasing function by the Illinois variant of regula falsi, within a bracket
// grown around 0 from the size of `guess`.
template <typename Function>
double root_of(const Function& excess, double guess) {
  double root = guess;
  const double reach = std::abs(guess) + 1.0e-9;
  double low = -reach;
  double high = reach;
  double at_low = excess(low);
  double at_high = excess(high);
  while (at_low > 0.0) at_low = excess(low = 2.0 * low);
  while (at_high < 0.0) at_high = excess(high = 2.0 * high);
  int side = 0;
  for (int i = 0; i < 100 && high - low > 1.0e-15 + 1.0e-12 * reach; ++i) {
    root = at_high > at_low ? (low * at_high - high * at_low) / (at_high - at_low)
                            : 0.5 * (low + high);
    if (i > 40) root = 0.5 * (low + high);
    const double there = excess(root);
    if (std::abs(there) < 1.0e-14 + 1.0e-11 * reach) break;
    if (there > 0.0) {
      high = root;
      at_high = there;
      if (side == 1) at_low *= 0.5;
      side = 1;
    } else {
      low = root;
      at_low = there;
      if (side == -1) at_high *= 0.5;
      side = -1;
    }
  }
  return root;
}

}  // namespace

Motion motion_of(const std::vector<Tone>& tones, double time_s) {
  Motion sum;
  for (const Tone& tone : tones) {
    double e0 = 1.0;
    double e1 = 0.0;
    double e2 = 0.0;
    for (const Tone::Envelope& slow : tone.envelope) {
      const double w = two_pi * slow.frequency_hz;
      const double angle = w * time_s + slow.phase_rad;
      e0 += slow.depth * std::sin(angle);
      e1 += slow.depth * w * std::cos(angle);
      e2 -= slow.depth * w * w * std::sin(angle);
    }
    const double w = two_pi * tone.frequency_hz;
    const double s = std::sin(w * time_s + tone.phase_rad);
    const double c = std::cos(w * time_s + tone.phase_rad);
    sum.value += tone.amplitude * e0 * s;
    sum.first += tone.amplitude * (e1 * s + e0 * w * c);
    sum.second += tone.amplitude * (e2 * s + 2.0 * e1 * w * c - e0 * w * w * s);
  }
  return sum;
}

double Wander::at(double time_s) const {
  if (knots.empty()) return 0.0;
  const double last = static_cast<double>(knots.size() - 1);
  const double place = std::clamp(time_s / step_s, 0.0, last);
  const auto before = static_cast<std::size_t>(place);
  const std::size_t after = std::min(before + 1, knots.size() - 1);
  return knots[before] + (place - static_cast<double>(before)) * (knots[after] - knots[before]);
}

// Butterworth low-pass by the bilinear transform with a prewarped cut-off.
void ReferenceSimulator::add_lowpass(std::vector<Biquad>& chain, int order, double cutoff_hz) {
  const double k = std::tan(std::numbers::pi * cutoff_hz * h);
  for (int pair = 0; pair < order / 2; ++pair) {
    const double q = 1.0 / (2.0 * std::sin(std::numbers::pi * (2.0 * pair + 1.0) / (2.0 * order)));
    const double norm = 1.0 / (1.0 + k / q + k * k);
    chain.push_back({k * k * norm, 2.0 * k * k * norm, k * k * norm, 2.0 * (k * k - 1.0) * norm,
                     (1.0 - k / q + k * k) * norm});
  }
  if (order % 2 == 1) {
    chain.push_back({k / (1.0 + k), k / (1.0 + k), 0.0, (k - 1.0) / (1.0 + k), 0.0});
  }
}

// H(s) = 3 / (3 + 3 s d + (s d)^2): group delay d at low frequencies.
void ReferenceSimulator::add_bessel(std::vector<Biquad>& chain, double delay_s) {
  const double c = 2.0 * delay_s / h;
  const double a0 = 3.0 + 3.0 * c + c * c;
  chain.push_back(
      {3.0 / a0, 6.0 / a0, 3.0 / a0, (6.0 - 2.0 * c * c) / a0, (3.0 - 3.0 * c + c * c) / a0});
}

ReferenceSimulator::ReferenceSimulator(const ReferenceRig& rig, double warm_up_s) : rig_(rig) {
  step_number_ = -static_cast<std::int64_t>(std::llround(warm_up_s / h));
  time_s_ = static_cast<double>(step_number_) * h;
  build_chains();
  if (rig_.excitation == physics::Excitation::imposed) {
    const Motion m = motion_of(rig_.drive, time_s_);
    state_.x = m.value;
    state_.v = m.first;
  } else if (rig_.well_linear_n_m > 0.0) {
    state_.x = std::sqrt(rig_.well_linear_n_m / rig_.well_cubic_n_m3);
  }
  state_.load = load_at(state_.x);
  advance(0.0);
  slipping_steps_ = all_steps_ = 0;
}

void ReferenceSimulator::replace(const ReferenceRig& rig) {
  const auto chain = chain_;
  const auto differentiator = differentiator_;
  rig_ = rig;
  build_chains();
  // Filters present before and after keep their state.
  const auto keep = [](const std::vector<Biquad>& from, std::vector<Biquad>& to) {
    for (std::size_t i = 0; i < std::min(from.size(), to.size()); ++i) {
      to[i].s1 = from[i].s1;
      to[i].s2 = from[i].s2;
    }
  };
  for (std::size_t c = 0; c < channel_count; ++c) keep(chain[c], chain_[c]);
  keep(differentiator, differentiator_);
}

void ReferenceSimulator::build_chains() {
  for (std::size_t c = 0; c < channel_count; ++c) {
    const Instrument& instrument = rig_.instrument[c];
    const bool velocity = c == index_of(Channel::velocity);
    chain_[c].clear();
    std::vector<Biquad>& chain = velocity ? differentiator_ : chain_[c];
    chain.clear();
    for (const physics::Filter& filter : instrument.filters) {
      const bool first = filter.kind == physics::FilterKind::first_order_lowpass;
      const double cutoff = velocity && first && rig_.differentiator_hz > 0.0
                                ? rig_.differentiator_hz
                                : filter.cutoff_hz.value;
      add_lowpass(chain, first ? 1 : filter.order, cutoff);
    }
    if (instrument.delay_s > 0.0 && instrument.bessel_delay) {
      add_bessel(chain_[c], instrument.delay_s);
    }
  }
}

double ReferenceSimulator::load_at(double x) const {
  const double n =
      rig_.load_n * (1.0 + rig_.load_slope_per_m * x + rig_.load_curvature_per_m2 * x * x);
  return std::max(0.0, n);
}

double ReferenceSimulator::friction_level(double slip, double x, double load, double time_s,
                                          State& middle) const {
  const ReferenceRig& n = rig_;
  const double speed = std::abs(slip);
  double level = n.mu * (n.loaded ? load : 1.0);
  if (n.load_exponent != 0.0 && load > 0.0) {
    const double ratio = load / n.load_n;
    level *= n.load_logarithmic ? std::max(0.0, 1.0 + n.load_exponent * std::log(ratio))
                                : std::pow(ratio, n.load_exponent);
  }
  if (n.mu_slope_per_m != 0.0) {
    const double along =
        n.mu_saturation_m > 0.0 ? n.mu_saturation_m * std::tanh(x / n.mu_saturation_m) : x;
    level *= std::max(0.0, 1.0 + n.mu_slope_per_m * along);
  }
  if (n.mu_drift_per_s != 0.0) {
    const double t = std::max(time_s, 0.0);
    const double so_far =
        n.mu_settling_s > 0.0 ? n.mu_settling_s * -std::expm1(-t / n.mu_settling_s) : t;
    level *= std::max(0.0, 1.0 + n.mu_drift_per_s * so_far);
  }
  if (n.ripple != 0.0) {
    level *= 1.0 + n.ripple * std::sin(two_pi * x / n.ripple_length_m + n.ripple_phase_rad);
  }
  if (n.event_friction != 0.0 && time_s >= n.event.from_s && time_s < n.event.to_s) {
    level *= 1.0 + n.event_friction;
  }
  if (n.static_ratio != 1.0) {
    level *= 1.0 + (n.static_ratio - 1.0) *
                       std::exp(-std::pow(speed / n.stribeck_speed_m_s, n.stribeck_power));
  }
  if (n.ageing_beta != 0.0) {
    // Dieterich's ageing; creep of a regularised law counts as rest.
    const double slips = std::max(0.0, speed - 1.5 * n.transition_speed_m_s);
    const double rested = (state_.rested_s + 0.5 * h) / (1.0 + 0.5 * h * slips / n.ageing_slip_m);
    middle.rested_s = rested;
    level *= 1.0 + n.ageing_beta * std::log1p(rested / n.ageing_tau_s);
  }
  const double side =
      n.asymmetry_speed_m_s > 0.0 ? std::tanh(slip / n.asymmetry_speed_m_s) : sign_of(slip);
  return level * (1.0 + n.asymmetry * side);
}

// The share of slip in the motion of the contact. `bent`: deflection in the direction of motion
// over that of break-away. Dupont's elasto-plastic bristle does not slip below its elastic share,
// nor on the way back; Dahl's always does.
double ReferenceSimulator::slip_share_of_bristle(double bent) const {
  const ReferenceRig& n = rig_;
  if (n.dahl_exponent > 0.0) {
    if (std::abs(bent) < 1.0e-6) return n.dahl_exponent;
    return (1.0 - std::pow(std::max(0.0, 1.0 - bent), n.dahl_exponent)) / bent;
  }
  if (std::abs(bent) >= 1.0) return 1.0;
  if (bent <= n.bristle_elastic_share) return 0.0;
  const double middle = 0.5 * (n.bristle_elastic_share + 1.0);
  return 0.5 + 0.5 * std::sin(std::numbers::pi * (bent - middle) / (1.0 - n.bristle_elastic_share));
}

// It slips at the level. The share of slip is that at the end of the last step.
double ReferenceSimulator::bristle_friction(double slip, double level, State& middle) const {
  const ReferenceRig& n = rig_;
  const double most = std::max(level, 1.0e-9) / n.bristle_n_m;
  const double slipping = slip_share_of_bristle(state_.bristle * sign_of(slip) / most);
  const double relaxation = 0.5 * h * slipping * std::abs(slip) / most;
  middle.bristle = (state_.bristle + 0.5 * h * slip) / (1.0 + relaxation);
  const double rate = (middle.bristle - state_.bristle) / (0.5 * h);
  const double damping =
      n.bristle_damping_speed_m_s > 0.0
          ? n.bristle_n_s_m * std::exp(-square(slip / n.bristle_damping_speed_m_s))
          : n.bristle_n_s_m;
  return n.bristle_n_m * middle.bristle + damping * rate;
}

// theta of the relaxation processes.
double ReferenceSimulator::relaxed(const State& state) const {
  const double share = rig_.relaxation_share;
  return share * state.theta_fast + (1.0 - share) * state.theta_slow;
}

double ReferenceSimulator::backbone_friction(double slip, double level, State& middle) const {
  const ReferenceRig& n = rig_;
  const double backbone =
      n.transition_speed_m_s > 0.0 ? std::tanh(slip / n.transition_speed_m_s) : sign_of(slip);
  if (!(n.relaxation_per_s > 0.0)) return level * backbone;
  // The mean lag of both, share / fast + (1 - share) / slow, is that of one process.
  const double slow = 0.5 * h * n.relaxation_per_s *
                      (n.relaxation_share / n.relaxation_ratio + 1.0 - n.relaxation_share);
  const double fast = n.relaxation_ratio * slow;
  middle.theta_fast = (state_.theta_fast + fast * backbone) / (1.0 + fast);
  middle.theta_slow = (state_.theta_slow + slow * backbone) / (1.0 + slow);
  return level * relaxed(middle);
}

double ReferenceSimulator::friction_at(double slip, double x, double load, double time_s,
                                       State& middle) const {
  const double level = friction_level(slip, x, load, time_s, middle);
  const double viscous =
      rig_.contact_viscosity_n_s_m * slip * (rig_.loaded && load <= 0.0 ? 0.0 : 1.0);
  const double dry = rig_.bristle_n_m > 0.0 ? bristle_friction(slip, level, middle)
                                            : backbone_friction(slip, level, middle);
  return dry + viscous;
}

// Forces on the mass that depend on position and time only.
double ReferenceSimulator::static_force(double x, double time_s) const {
  const ReferenceRig& n = rig_;
  double force = -n.stiffness_n_m * x + n.well_linear_n_m * x - n.well_cubic_n_m3 * x * x * x;
  if (n.cubic_n_m3 != 0.0) {
    if (n.sinh_length_m > 0.0) {
      const double s = n.sinh_length_m;
      force -= 6.0 * n.cubic_n_m3 * s * s * (s * std::sinh(x / s) - x);
    } else {
      force -= n.cubic_n_m3 * x * x * x;
    }
  }
  force -= n.quadratic_n_m2 * x * x;
  if (n.stop_stiffness > 0.0) {
    if (x > n.stop_gap_m && n.stop_side >= 0) {
      force -= n.stop_stiffness * std::pow(x - n.stop_gap_m, n.stop_power);
    }
    if (x < -n.stop_gap_m && n.stop_side <= 0) {
      force += n.stop_stiffness * std::pow(-x - n.stop_gap_m, n.stop_power);
    }
  }
  force += n.bias_n;
  if (n.ambient_n != 0.0) {
    const double phase = two_pi * n.ambient_hz * time_s + n.ambient_phase_rad;
    force += n.ambient_n * (std::sin(phase) + n.ambient_harmonic * std::sin(2.0 * phase));
  }
  if (n.bump_n != 0.0) {
    const double s = (x - n.bump_at_m) / n.bump_width_m;
    force -= n.bump_n * s * std::exp(0.5 * (1.0 - s * s));
  }
  if (n.event_force_n != 0.0 && time_s >= n.event.from_s && time_s < n.event.to_s) {
    force += n.event_force_n;
  }
  return force;
}

double ReferenceSimulator::iwan_break_away_m(std::size_t element) const {
  const ReferenceRig& n = rig_;
  return n.iwan_slip_n * n.iwan_slip_share[element] /
         (n.iwan_n_m * n.iwan_stiffness_share[element]);
}

double ReferenceSimulator::iwan_force(State& middle) const {
  const ReferenceRig& n = rig_;
  double force = 0.0;
  if (!(n.iwan_n_m > 0.0)) return force;
  for (std::size_t i = 0; i < iwan_elements; ++i) {
    const double most = iwan_break_away_m(i);
    middle.iwan[i] = std::clamp(state_.iwan[i] + 0.5 * h * state_.v, -most, most);
    force += n.iwan_n_m * n.iwan_stiffness_share[i] * middle.iwan[i];
  }
  return force;
}

ReferenceSimulator::FreeBody ReferenceSimulator::free_mass(double x, double force) const {
  const ReferenceRig& n = rig_;
  const double damping = n.damping_n_s_m + n.position_damping_n_s_m3 * x * x +
                         n.drag * std::pow(std::abs(state_.v), n.drag_power - 1.0);
  const double inertia = n.mass_kg + 0.5 * h * damping;
  return {(n.mass_kg * state_.v + 0.5 * h * force) / inertia, inertia};
}

ReferenceSimulator::FreeBody ReferenceSimulator::free_load_cell(double base_acceleration) const {
  const ReferenceRig& n = rig_;
  const double omega = two_pi * n.cell_frequency_hz;
  const double k = n.cell_mass_kg * omega * omega;
  const double c = 2.0 * n.cell_damping_ratio * omega * n.cell_mass_kg;
  const double inertia = n.cell_mass_kg + 0.5 * h * c;
  const double y = state_.y + 0.5 * h * state_.w;
  return {(n.cell_mass_kg * state_.w + 0.5 * h * (-k * y - n.cell_mass_kg * base_acceleration)) /
              inertia,
          inertia};
}

// Solves slip + mobility friction(slip) = free_slip; the left side increases with slip. The root
// lies between 0 and free_slip unless an internal state drives the slip.
ReferenceSimulator::Contact ReferenceSimulator::solve_contact(double free_slip, double mobility,
                                                              double x, double load, double time_s,
                                                              State& middle) const {
  const ReferenceRig& n = rig_;
  if (!n.friction) return {free_slip, 0.0};
  const bool set_valued =
      n.transition_speed_m_s == 0.0 && n.bristle_n_m == 0.0 && n.relaxation_per_s == 0.0;
  const auto excess = [&](double slip) {
    return slip + mobility * friction_at(slip, x, load, time_s, middle) - free_slip;
  };
  constexpr double tiny = 1.0e-12;
  if (set_valued && excess(-tiny) <= 0.0 && excess(tiny) >= 0.0) {
    return {0.0, free_slip / mobility};
  }
  const double slip = root_of(excess, free_slip);
  return {slip, friction_at(slip, x, load, time_s, middle)};
}

ReferenceSimulator::Contact ReferenceSimulator::step_imposed(const Motion& drive, double middle_s,
                                                             State& middle) {
  const double slip = drive.first;
  const double load = load_at(drive.value);
  const double friction =
      rig_.friction ? friction_at(slip, drive.value, load, middle_s, middle) : 0.0;
  const Motion end = motion_of(rig_.drive, time_s_ + h);
  state_.x = end.value;
  state_.v = end.first;
  return {slip, friction};
}

ReferenceSimulator::Contact ReferenceSimulator::step_free(const Motion& drive, double middle_s,
                                                          State& middle) {
  const ReferenceRig& n = rig_;
  const double base = n.excitation == physics::Excitation::base ? drive.second : 0.0;
  const double x = state_.x + 0.5 * h * state_.v;
  const double load = load_at(x);
  double force = static_force(x, middle_s) - iwan_force(middle) - n.mass_kg * base;
  if (n.excitation == physics::Excitation::force) force += drive.value;
  const FreeBody mass = free_mass(x, force);
  const bool rings = n.cell && n.cell_rings;
  const FreeBody cell = rings ? free_load_cell(base) : FreeBody{};
  double mobility = 0.5 * h / mass.inertia;
  if (rings) mobility += 0.5 * h / cell.inertia;
  const Contact contact =
      solve_contact(mass.velocity - cell.velocity, mobility, x, load, middle_s, middle);

  const double v_middle = mass.velocity - 0.5 * h / mass.inertia * contact.friction;
  state_.v = 2.0 * v_middle - state_.v;
  state_.x = x + 0.5 * h * state_.v;
  if (rings) {
    const double w_middle = cell.velocity + 0.5 * h / cell.inertia * contact.friction;
    const double y = state_.y + 0.5 * h * state_.w;
    state_.w = 2.0 * w_middle - state_.w;
    state_.y = y + 0.5 * h * state_.w;
  } else if (n.cell) {
    const double omega = two_pi * n.cell_frequency_hz;
    state_.y = (contact.friction - n.cell_mass_kg * base) / (n.cell_mass_kg * omega * omega);
  }
  for (std::size_t i = 0; i < iwan_elements && n.iwan_n_m > 0.0; ++i) {
    const double most = iwan_break_away_m(i);
    state_.iwan[i] = std::clamp(middle.iwan[i] + 0.5 * h * state_.v, -most, most);
  }
  if (n.mode_hz > 0.0) advance_second_mode(contact.friction, base);
  return contact;
}

void ReferenceSimulator::advance_second_mode(double friction, double base_acceleration) {
  const ReferenceRig& n = rig_;
  const double omega = two_pi * n.mode_hz;
  const double q = state_.q + 0.5 * h * state_.qv;
  const double acceleration = -omega * omega * q - n.mode_friction_per_kg * friction -
                              n.mode_base_share * base_acceleration;
  const double qv = (state_.qv + 0.5 * h * acceleration) / (1.0 + h * n.mode_damping_ratio * omega);
  state_.qv = 2.0 * qv - state_.qv;
  state_.q = q + 0.5 * h * state_.qv;
}

void ReferenceSimulator::step() {
  const double middle_s = time_s_ + 0.5 * h;
  const Motion drive = motion_of(rig_.drive, middle_s);
  State middle = state_;
  const Contact contact = rig_.excitation == physics::Excitation::imposed
                              ? step_imposed(drive, middle_s, middle)
                              : step_free(drive, middle_s, middle);
  state_.theta_fast = 2.0 * middle.theta_fast - state_.theta_fast;
  state_.theta_slow = 2.0 * middle.theta_slow - state_.theta_slow;
  state_.bristle = 2.0 * middle.bristle - state_.bristle;
  state_.rested_s = std::max(0.0, 2.0 * middle.rested_s - state_.rested_s);
  state_.slip = contact.slip;
  state_.friction = contact.friction;
  state_.load = load_at(state_.x);
  ++step_number_;
  time_s_ = static_cast<double>(step_number_) * h;
  ++all_steps_;
  const double still = rig_.transition_speed_m_s > 0.0 ? rig_.transition_speed_m_s : 1.0e-6;
  if (std::abs(contact.slip) > still) ++slipping_steps_;
}

ReferenceSimulator::Channels ReferenceSimulator::true_quantities(const Motion& drive) const {
  const ReferenceRig& n = rig_;
  const bool driven_by_base = n.excitation == physics::Excitation::base;
  Channels quantity{};
  quantity[index_of(Channel::displacement)] = state_.x + (n.mode_hz > 0.0 ? state_.q : 0.0);
  quantity[index_of(Channel::friction_force)] =
      n.cell ? n.cell_mass_kg * square(two_pi * n.cell_frequency_hz) * state_.y : state_.friction;
  quantity[index_of(Channel::normal_load)] = state_.load;
  quantity[index_of(Channel::base_displacement)] = driven_by_base ? drive.value : 0.0;
  quantity[index_of(Channel::drive_force)] =
      n.excitation == physics::Excitation::force ? drive.value : 0.0;
  return quantity;
}

// The velocity is the derivative of the filtered displacement, free of its sensor errors.
ReferenceSimulator::Channels ReferenceSimulator::filtered(const Channels& quantity) {
  Channels out{};
  const std::size_t x = index_of(Channel::displacement);
  const std::size_t v = index_of(Channel::velocity);
  for (std::size_t c = 0; c < channel_count; ++c) {
    if (c == v) continue;
    const Instrument& instrument = rig_.instrument[c];
    double value = quantity[c];
    const std::size_t own =
        chain_[c].size() - (instrument.delay_s > 0.0 && instrument.bessel_delay ? 1 : 0);
    for (std::size_t i = 0; i < own; ++i) value = chain_[c][i].step(value);
    out[c] = value;
  }
  double slope = has_last_displacement_ ? (out[x] - last_displacement_) / h : 0.0;
  last_displacement_ = out[x];
  has_last_displacement_ = true;
  for (Biquad& section : differentiator_) slope = section.step(slope);
  out[v] = slope;
  return out;
}

double ReferenceSimulator::delayed(std::size_t channel, double value) {
  const Instrument& instrument = rig_.instrument[channel];
  if (!(instrument.delay_s > 0.0)) return value;
  if (instrument.bessel_delay) return chain_[channel].back().step(value);
  std::deque<double>& line = delay_line_[channel];
  line.push_back(value);
  const double steps = instrument.delay_s / h;
  const auto whole = static_cast<std::size_t>(steps);
  while (line.size() > whole + 2) line.pop_front();
  if (line.size() != whole + 2) return value;
  const double part = steps - static_cast<double>(whole);
  return (1.0 - part) * line[1] + part * line[0];
}

void ReferenceSimulator::update_readings() {
  const Motion drive = motion_of(rig_.drive, time_s_);
  const Channels ideal = filtered(true_quantities(drive));
  const double t = std::max(time_s_, 0.0);
  for (std::size_t c = 0; c < channel_count; ++c) {
    const Instrument& r = rig_.instrument[c];
    double value = r.gain * delayed(c, ideal[c]);
    if (r.crosstalk != 0.0) value += r.crosstalk * ideal[index_of(r.crosstalk_from)];
    if (r.hum_amplitude != 0.0) {
      value += r.hum_amplitude * (1.0 + r.hum_wander.at(time_s_)) *
               std::sin(two_pi * r.hum_hz * time_s_ + 0.7);
    }
    value += r.offset;
    if (r.drift_per_s != 0.0) {
      value += r.drift_per_s * (r.drift_settling_s > 0.0
                                    ? r.drift_settling_s * -std::expm1(-t / r.drift_settling_s)
                                    : t);
    }
    value += r.drift_wander.at(t);
    if (r.limit > 0.0) value = std::clamp(value, -r.limit, r.limit);
    readings_[c] = value;
  }
}

void ReferenceSimulator::advance(double time_s) {
  const auto last = static_cast<std::int64_t>(std::llround(time_s / h));
  while (step_number_ < last) {
    step();
    update_readings();
  }
}

double ReferenceSimulator::theta() const {
  const ReferenceRig& n = rig_;
  if (!n.friction) return 0.0;
  if (n.bristle_n_m == 0.0 && n.relaxation_per_s > 0.0) return relaxed(state_);
  if (n.bristle_n_m == 0.0 && n.transition_speed_m_s > 0.0) {
    return std::tanh(state_.slip / n.transition_speed_m_s);
  }
  const double level = n.mu * (n.loaded ? state_.load : 1.0);
  return level > 0.0 ? state_.friction / level : 0.0;
}

physics::RigTruth ReferenceSimulator::truth() const {
  return {.displacement_m = state_.x,
          .velocity_m_s = state_.v,
          .load_cell_deflection_m = state_.y,
          .load_cell_velocity_m_s = state_.w,
          .slip_velocity_m_s = state_.slip,
          .theta = theta(),
          .friction_force_n = state_.friction,
          .normal_load_n = rig_.loaded ? state_.load : 1.0};
}

double ReferenceSimulator::slip_share() const {
  return all_steps_ == 0 ? 0.0
                         : static_cast<double>(slipping_steps_) / static_cast<double>(all_steps_);
}

}  // namespace stickslip::concealment
