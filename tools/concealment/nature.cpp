#include "tools/concealment/nature.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stickslip::concealment {

namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;
constexpr double h = nature_step_s;

double square(double value) { return value * value; }
double sign_of(double value) { return value > 0.0 ? 1.0 : (value < 0.0 ? -1.0 : 0.0); }

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

// A Butterworth low-pass by the bilinear transform, its cut-off in the right place.
void RigRun::add_lowpass(std::vector<Section>& chain, int order, double cutoff_hz) {
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

// H(s) = 3 / (3 + 3 s d + (s d)^2): its group delay at low frequencies is d.
void RigRun::add_bessel(std::vector<Section>& chain, double delay_s) {
  const double c = 2.0 * delay_s / h;
  const double a0 = 3.0 + 3.0 * c + c * c;
  chain.push_back(
      {3.0 / a0, 6.0 / a0, 3.0 / a0, (6.0 - 2.0 * c * c) / a0, (3.0 - 3.0 * c + c * c) / a0});
}

RigRun::RigRun(const Nature& nature, double warm_up_s) : nature_(nature) {
  step_number_ = -static_cast<std::int64_t>(std::llround(warm_up_s / h));
  time_s_ = static_cast<double>(step_number_) * h;
  build_chains();
  if (nature_.excitation == physics::Excitation::imposed) {
    const Motion m = motion_of(nature_.drive, time_s_);
    at_.x = m.value;
    at_.v = m.first;
  } else if (nature_.well_linear_n_m > 0.0) {
    at_.x = std::sqrt(nature_.well_linear_n_m / nature_.well_cubic_n_m3);
  }
  at_.load = load_at(at_.x);
  advance(0.0);
  slipping_steps_ = all_steps_ = 0;
}

void RigRun::replace(const Nature& nature) {
  const auto chain = chain_;
  const auto differentiator = differentiator_;
  nature_ = nature;
  build_chains();
  // What the filters hold goes on in those that are still there.
  const auto keep = [](const std::vector<Section>& from, std::vector<Section>& to) {
    for (std::size_t i = 0; i < std::min(from.size(), to.size()); ++i) {
      to[i].s1 = from[i].s1;
      to[i].s2 = from[i].s2;
    }
  };
  for (std::size_t c = 0; c < channel_count; ++c) keep(chain[c], chain_[c]);
  keep(differentiator, differentiator_);
}

void RigRun::build_chains() {
  for (std::size_t c = 0; c < channel_count; ++c) {
    chain_[c].clear();
    if (c == index_of(Channel::velocity)) {
      differentiator_.clear();
      for (const physics::Filter& filter : nature_.reading[c].filters) {
        const bool first = filter.kind == physics::FilterKind::first_order_lowpass;
        const double cutoff =
            first && nature_.differentiator_hz > 0.0 ? nature_.differentiator_hz : filter.cutoff_hz;
        add_lowpass(differentiator_, first ? 1 : filter.order, cutoff);
      }
    } else {
      for (const physics::Filter& filter : nature_.reading[c].filters) {
        const bool first = filter.kind == physics::FilterKind::first_order_lowpass;
        add_lowpass(chain_[c], first ? 1 : filter.order, filter.cutoff_hz);
      }
    }
    const Reading& reading = nature_.reading[c];
    if (reading.delay_s > 0.0 && reading.bessel_delay) add_bessel(chain_[c], reading.delay_s);
  }
}

double RigRun::load_at(double x) const {
  const double n =
      nature_.load_n * (1.0 + nature_.load_slope_per_m * x + nature_.load_curvature_per_m2 * x * x);
  return std::max(0.0, n);
}

double RigRun::friction_at(double slip, double x, double load, double time_s,
                           Mechanics& middle) const {
  const Nature& n = nature_;
  const double speed = std::abs(slip);
  double level = n.mu * (n.loaded ? load : 1.0);
  if (n.load_exponent != 0.0 && load > 0.0) level *= std::pow(load / n.load_n, n.load_exponent);
  if (n.mu_slope_per_m != 0.0) {
    const double along =
        n.mu_saturates_m > 0.0 ? n.mu_saturates_m * std::tanh(x / n.mu_saturates_m) : x;
    level *= std::max(0.0, 1.0 + n.mu_slope_per_m * along);
  }
  if (n.mu_drift_per_s != 0.0) {
    const double t = std::max(time_s, 0.0);
    const double so_far =
        n.mu_settles_s > 0.0 ? n.mu_settles_s * -std::expm1(-t / n.mu_settles_s) : t;
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
    // Dieterich's ageing; the creep of a smoothed law counts as rest.
    const double slips = std::max(0.0, speed - 1.5 * n.transition_speed_m_s);
    const double rested = (at_.rested_s + 0.5 * h) / (1.0 + 0.5 * h * slips / n.ageing_slip_m);
    middle.rested_s = rested;
    level *= 1.0 + n.ageing_beta * std::log1p(rested / n.ageing_tau_s);
  }
  level *= 1.0 + n.asymmetry * sign_of(slip);
  const double viscous = n.contact_viscosity_n_s_m * slip * (n.loaded && load <= 0.0 ? 0.0 : 1.0);

  if (n.bristle_n_m > 0.0) {
    // Dupont's elasto-plastic bristle: it slips at the level, and not at all while it is bent less
    // than its elastic share. The share of slip is taken where the last step ended.
    const double most = std::max(level, 1.0e-9) / n.bristle_n_m;
    double slipping = 0.0;
    const double bent = std::abs(at_.bristle);
    if (at_.bristle * slip > 0.0 || bent > most) {
      const double elastic = n.bristle_elastic_share * most;
      if (bent >= most) {
        slipping = 1.0;
      } else if (bent > elastic) {
        slipping = 0.5 + 0.5 * std::sin(std::numbers::pi *
                                        ((bent - 0.5 * (elastic + most)) / (most - elastic)));
      }
    }
    const double forgets = 0.5 * h * slipping * speed / most;
    middle.bristle = (at_.bristle + 0.5 * h * slip) / (1.0 + forgets);
    const double bending = (middle.bristle - at_.bristle) / (0.5 * h);
    return n.bristle_n_m * middle.bristle + n.bristle_n_s_m * bending + viscous;
  }
  const double backbone =
      n.transition_speed_m_s > 0.0 ? std::tanh(slip / n.transition_speed_m_s) : sign_of(slip);
  if (n.relaxation_per_s > 0.0) {
    // With weights 1/2 + spread/2 and 1/2 - spread/2 the mean lag is that of one process.
    const double fast = 0.5 * h * n.relaxation_per_s * (1.0 + n.relaxation_spread);
    const double slow = 0.5 * h * n.relaxation_per_s * (1.0 - n.relaxation_spread);
    middle.theta_fast = (at_.theta_fast + fast * backbone) / (1.0 + fast);
    middle.theta_slow = (at_.theta_slow + slow * backbone) / (1.0 + slow);
    const double share = 0.5 * (1.0 + n.relaxation_spread);
    return level * (share * middle.theta_fast + (1.0 - share) * middle.theta_slow) + viscous;
  }
  return level * backbone + viscous;
}

// What acts on the mass by where it is and when, damping and friction aside.
double RigRun::static_force(double x, double time_s) const {
  const Nature& n = nature_;
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
    force += n.ambient_n * std::sin(two_pi * n.ambient_hz * time_s + n.ambient_phase_rad);
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

void RigRun::step() {
  const Nature& n = nature_;
  const double middle_s = time_s_ + 0.5 * h;
  const Motion drive = motion_of(n.drive, middle_s);
  const bool imposed = n.excitation == physics::Excitation::imposed;
  const double base = n.excitation == physics::Excitation::base ? drive.second : 0.0;
  Mechanics middle = at_;
  const double x = imposed ? drive.value : at_.x + 0.5 * h * at_.v;
  const double load = load_at(x);

  double slip = 0.0;
  double friction = 0.0;
  if (imposed) {
    slip = drive.first;
    friction = n.friction ? friction_at(slip, x, load, middle_s, middle) : 0.0;
    const Motion end = motion_of(n.drive, time_s_ + h);
    at_.x = end.value;
    at_.v = end.first;
  } else {
    // The elements of an Iwan chain follow the deflection and slip each at its own share.
    double hysteretic = 0.0;
    if (n.iwan_n_m > 0.0) {
      for (std::size_t i = 0; i < iwan_elements; ++i) {
        // Slip levels 1/3, 2/3, 1, 4/3, 5/3 of their mean.
        const double stiffness = n.iwan_n_m / iwan_elements;
        const double most = n.iwan_slip_n / iwan_elements * (static_cast<double>(i) + 1.0) / 3.0;
        const double stretch = at_.iwan[i] + 0.5 * h * at_.v;
        middle.iwan[i] = std::clamp(stretch, -most / stiffness, most / stiffness);
        hysteretic += stiffness * middle.iwan[i];
      }
    }
    double force = static_force(x, middle_s) - hysteretic - n.mass_kg * base;
    if (n.excitation == physics::Excitation::force) force += drive.value;
    const double damping = n.damping_n_s_m + n.position_damping_n_s_m3 * x * x +
                           n.drag * std::pow(std::abs(at_.v), n.drag_power - 1.0);
    const double inertia = n.mass_kg + 0.5 * h * damping;
    const double v_free = (n.mass_kg * at_.v + 0.5 * h * force) / inertia;
    double w_free = 0.0;
    double mobility = 0.5 * h / inertia;
    double cell_inertia = 0.0;
    const bool rings = n.cell && n.cell_rings;
    if (rings) {
      const double omega = two_pi * n.cell_frequency_hz;
      const double k = n.cell_mass_kg * omega * omega;
      const double c = 2.0 * n.cell_damping_ratio * omega * n.cell_mass_kg;
      cell_inertia = n.cell_mass_kg + 0.5 * h * c;
      const double y = at_.y + 0.5 * h * at_.w;
      w_free = (n.cell_mass_kg * at_.w + 0.5 * h * (-k * y - n.cell_mass_kg * base)) / cell_inertia;
      mobility += 0.5 * h / cell_inertia;
    }
    const double slip_free = v_free - w_free;
    slip = slip_free;
    if (n.friction) {
      // slip + mobility friction(slip) = slip_free, which grows with slip. The root lies between 0
      // and slip_free unless a hidden state pushes.
      const bool set_valued =
          n.transition_speed_m_s == 0.0 && n.bristle_n_m == 0.0 && n.relaxation_per_s == 0.0;
      const auto excess = [&](double u) {
        return u + mobility * friction_at(u, x, load, middle_s, middle) - slip_free;
      };
      constexpr double tiny = 1.0e-12;
      if (set_valued && excess(-tiny) <= 0.0 && excess(tiny) >= 0.0) {
        slip = 0.0;
        friction = slip_free / mobility;
      } else {
        double reach = std::abs(slip_free) + 1.0e-9;
        double low = -reach;
        double high = reach;
        double at_low = excess(low);
        double at_high = excess(high);
        while (at_low > 0.0) at_low = excess(low = 2.0 * low);
        while (at_high < 0.0) at_high = excess(high = 2.0 * high);
        // Illinois: the secant of the bracket, the end that stays counted half.
        int side = 0;
        for (int i = 0; i < 100 && high - low > 1.0e-15 + 1.0e-12 * reach; ++i) {
          slip = at_high > at_low ? (low * at_high - high * at_low) / (at_high - at_low)
                                  : 0.5 * (low + high);
          if (i > 40) slip = 0.5 * (low + high);
          const double there = excess(slip);
          if (std::abs(there) < 1.0e-14 + 1.0e-11 * reach) break;
          if (there > 0.0) {
            high = slip;
            at_high = there;
            if (side == 1) at_low *= 0.5;
            side = 1;
          } else {
            low = slip;
            at_low = there;
            if (side == -1) at_high *= 0.5;
            side = -1;
          }
        }
        friction = friction_at(slip, x, load, middle_s, middle);
      }
    }
    const double v_middle = v_free - 0.5 * h / inertia * friction;
    at_.v = 2.0 * v_middle - at_.v;
    at_.x = x + 0.5 * h * at_.v;
    if (rings) {
      const double w_middle = w_free + 0.5 * h / cell_inertia * friction;
      const double y = at_.y + 0.5 * h * at_.w;
      at_.w = 2.0 * w_middle - at_.w;
      at_.y = y + 0.5 * h * at_.w;
    } else if (n.cell) {
      const double omega = two_pi * n.cell_frequency_hz;
      at_.y = (friction - n.cell_mass_kg * base) / (n.cell_mass_kg * omega * omega);
    }
    for (std::size_t i = 0; i < iwan_elements && n.iwan_n_m > 0.0; ++i) {
      const double most = n.iwan_slip_n / n.iwan_n_m * (static_cast<double>(i) + 1.0) / 3.0;
      at_.iwan[i] = std::clamp(middle.iwan[i] + 0.5 * h * at_.v, -most, most);
    }
    if (n.mode_hz > 0.0) {
      const double omega = two_pi * n.mode_hz;
      const double q = at_.q + 0.5 * h * at_.qv;
      const double pushed =
          -omega * omega * q - n.mode_friction_per_kg * friction - n.mode_base_share * base;
      const double qv = (at_.qv + 0.5 * h * pushed) / (1.0 + h * n.mode_damping_ratio * omega);
      at_.qv = 2.0 * qv - at_.qv;
      at_.q = q + 0.5 * h * at_.qv;
    }
  }
  at_.theta_fast = 2.0 * middle.theta_fast - at_.theta_fast;
  at_.theta_slow = 2.0 * middle.theta_slow - at_.theta_slow;
  at_.bristle = 2.0 * middle.bristle - at_.bristle;
  at_.rested_s = std::max(0.0, 2.0 * middle.rested_s - at_.rested_s);
  at_.slip = slip;
  at_.friction = friction;
  at_.load = load_at(at_.x);
  ++step_number_;
  time_s_ = static_cast<double>(step_number_) * h;
  ++all_steps_;
  const double still = n.transition_speed_m_s > 0.0 ? n.transition_speed_m_s : 1.0e-6;
  if (std::abs(slip) > still) ++slipping_steps_;
}

void RigRun::sense() {
  const Nature& n = nature_;
  const Motion drive = motion_of(n.drive, time_s_);
  const bool driven_by_base = n.excitation == physics::Excitation::base;
  std::array<double, channel_count> quantity{};
  quantity[index_of(Channel::displacement)] = at_.x + (n.mode_hz > 0.0 ? at_.q : 0.0);
  quantity[index_of(Channel::friction_force)] =
      n.cell ? n.cell_mass_kg * square(two_pi * n.cell_frequency_hz) * at_.y : at_.friction;
  quantity[index_of(Channel::normal_load)] = at_.load;
  quantity[index_of(Channel::base_displacement)] = driven_by_base ? drive.value : 0.0;
  quantity[index_of(Channel::drive_force)] =
      n.excitation == physics::Excitation::force ? drive.value : 0.0;
  std::array<double, channel_count> filtered{};
  const std::size_t x = index_of(Channel::displacement);
  const std::size_t v = index_of(Channel::velocity);
  // The differentiator follows the displacement's filters, not its faults.
  for (std::size_t c = 0; c < channel_count; ++c) {
    if (c == v) continue;
    double value = quantity[c];
    const std::size_t own =
        chain_[c].size() - (n.reading[c].delay_s > 0.0 && n.reading[c].bessel_delay ? 1 : 0);
    for (std::size_t i = 0; i < own; ++i) value = chain_[c][i].step(value);
    filtered[c] = value;
  }
  double slope = sensed_ ? (filtered[x] - last_displacement_) / h : 0.0;
  last_displacement_ = filtered[x];
  sensed_ = true;
  for (Section& section : differentiator_) slope = section.step(slope);
  filtered[v] = slope;

  std::array<double, channel_count> late = filtered;
  for (std::size_t c = 0; c < channel_count; ++c) {
    const Reading& r = n.reading[c];
    if (!(r.delay_s > 0.0)) continue;
    if (r.bessel_delay) {
      late[c] = chain_[c].back().step(filtered[c]);
    } else {
      line_[c].push_back(filtered[c]);
      const double steps = r.delay_s / h;
      const auto whole = static_cast<std::size_t>(steps);
      while (line_[c].size() > whole + 2) line_[c].pop_front();
      if (line_[c].size() == whole + 2) {
        const double part = steps - static_cast<double>(whole);
        late[c] = (1.0 - part) * line_[c][1] + part * line_[c][0];
      }
    }
  }
  const double t = std::max(time_s_, 0.0);
  for (std::size_t c = 0; c < channel_count; ++c) {
    const Reading& r = n.reading[c];
    double value = r.gain * late[c];
    if (r.leak != 0.0) value += r.leak * filtered[index_of(r.leak_from)];
    if (r.hum_amplitude != 0.0) {
      value += r.hum_amplitude * (1.0 + r.hum_wander * std::sin(two_pi * 0.13 * time_s_)) *
               std::sin(two_pi * r.hum_hz * time_s_ + 0.7);
    }
    if (r.drift_per_s != 0.0) {
      value +=
          r.drift_per_s *
          (r.drift_settles_s > 0.0 ? r.drift_settles_s * -std::expm1(-t / r.drift_settles_s) : t);
    }
    if (r.limit > 0.0) value = std::clamp(value, -r.limit, r.limit);
    now_[c] = value;
  }
}

void RigRun::advance(double time_s) {
  const auto last = static_cast<std::int64_t>(std::llround(time_s / h));
  while (step_number_ < last) {
    step();
    sense();
  }
}

std::array<double, channel_count> RigRun::read() const { return now_; }

double RigRun::slip_share() const {
  return all_steps_ == 0 ? 0.0
                         : static_cast<double>(slipping_steps_) / static_cast<double>(all_steps_);
}

}  // namespace stickslip::concealment
