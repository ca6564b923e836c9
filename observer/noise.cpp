#include "observer/noise.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "observer/reading_states.h"
#include "physics/backbone.h"

namespace stickslip::observer {

namespace {

using physics::Excitation;
using physics::Kinetics;
using physics::Parameter;
namespace state = physics::state;
using std::numbers::pi;

double square(double x) { return x * x; }
double sixth(double x) { return square(x * x * x); }

// Unmodelled forces: this fraction of mu N and of the spring's force, alike over this time.
constexpr double force_doubt = 0.002;
constexpr double spring_doubt = 0.0005;
constexpr double force_memory_s = 0.01;
// What the model itself doubts of mass, spring and damping does not change from one moment to the
// next. DoubtedConstants follows it; this share of it stays noise, so that the filter leans on its
// model a little less.
constexpr double constant_share = 0.6;
// The backbone g: this much off, alike over force_memory_s.
constexpr double backbone_doubt = 0.002;
// Random walks of the parameters, as a fraction of their size over the root of a second.
constexpr double mu_walk = 0.0005;
constexpr double rate_walk = 0.005;
constexpr double load_walk = 0.002;
constexpr double load_rate_walk = 20.0;
constexpr double frequency_walk = 0.05;
// At first mu and gamma are learnt where the filter is not yet right about the motion: what it then
// holds to be known is forgotten again over this time, as if they had walked by these fractions.
constexpr double restless_s = 1.5;
constexpr double mu_restlessness = 0.2;
constexpr double rate_restlessness = 0.3;
// What is at least in doubt about parameters at the start, as a fraction.
constexpr double mu_doubt = 0.3;
constexpr double learnt_doubt = 0.05;  // where they were learnt before
// Beyond these, as a share of what the model says and as a logarithm, they are absurd.
constexpr double absurd_mu = 1.0 / 30.0;
constexpr double absurd_log = 3.5;
// A drive's frequency is sought below this.
constexpr double most_drive_rad_s = 2.0 * pi * 40.0;
constexpr double drive_lesson_s = 1.0;
constexpr double drive_trend_s = 0.01;
// Doubt of the slip velocity makes the backbone doubtful; alike over this time.
constexpr double jump_memory_s = 5.0e-4;
// Of it this share is not taken back by the next readings; what observer_campaign found right.
constexpr double jump_share = 0.1;
// mu is learnt from slip faster than this many (doubtful) transition speeds.
constexpr double lesson_speeds = 2.0;
constexpr double noise_hearing_s = 1.0;
// A zero that wanders walks in this time as far as it drifts in it.
constexpr double offset_memory_s = 10.0;

double relative(const Parameter& p) { return p.value != 0.0 ? std::abs(p.sigma / p.value) : 0.0; }

double relative(const std::optional<Parameter>& p) { return p ? relative(*p) : 0.0; }

}  // namespace

Noise::Noise(const physics::Model& model, const physics::Rig& rig, const Layout& layout,
             const physics::RigNumbers<double>& numbers, double period_s, Contact contact)
    : model_(&model),
      rig_(&rig),
      layout_(&layout),
      numbers_(&numbers),
      period_s_(period_s),
      contact_(contact) {
  const auto& c = numbers.c;
  const double stiffness = rig.structure().two_well ? 2.0 * c.well_linear : c.stiffness;
  log_rate_ = std::log(std::max(c.rate, 1.0e-300));
  natural_rad_s_ = std::max(std::sqrt(stiffness / c.mass), 2.0 * pi * 0.5);
  const physics::Oscillator& oscillator = model.oscillator;
  mass_doubt_kg_ = constant_share * oscillator.mass_kg.sigma;
  const double spring_sigma =
      std::max(relative(oscillator.stiffness_n_m), 2.0 * relative(oscillator.natural_frequency_hz));
  spring_doubt_n_m_ = c.stiffness * std::max(spring_doubt, constant_share * spring_sigma);
  if (oscillator.two_well) {
    spring_doubt_n_m_ = std::max(constant_share * oscillator.two_well->linear_n_m.sigma,
                                 spring_doubt * c.well_linear);
  }
  damping_doubt_n_s_m_ =
      constant_share * c.damping *
      std::max(relative(oscillator.damping_ratio), relative(oscillator.damping_n_s_m));
  cell_doubt_n_m_ = 0.0;
  if (model.load_cell) {
    cell_doubt_n_m_ = c.cell_stiffness *
                      std::max(spring_doubt, 2.0 * relative(model.load_cell->natural_frequency_hz));
  }
  for (Channel channel : all_channels) {
    const auto& declared = model.sensors[index_of(channel)].noise_std;
    listeners_[index_of(channel)].declared = declared ? square(*declared) : 0.0;
  }
  // A Kalman filter for p''' = white noise of density q and readings of density r follows up to
  // (q / r)^(1/6) rad/s; the drive's density may move between what that means for 0.3 and 60 Hz.
  least_log_density_ = std::log(sixth(2.0 * pi * 0.3));
  most_log_density_ = std::log(sixth(2.0 * pi * 60.0));
  log_jerk_density_ = std::log(sixth(2.0 * pi * 20.0));
}

double Noise::reading_variance(Channel channel) const {
  const Listener& listener = listeners_[index_of(channel)];
  if (listener.declared > 0.0) return listener.declared;
  const double floor = square(1.0e-4 * listener.size) + 1.0e-24;
  if (listener.heard == 0.0) return square(0.02 * listener.size) + floor;
  return std::max(listener.variance, floor);
}

// The third difference of a reading behind an anti-alias filter is noise alone, 20 times its
// variance; where it is not, the reading is thought noisier than it is, which is the safe side.
void Noise::listen(const Frame& frame) {
  for (Channel channel : all_channels) {
    Listener& listener = listeners_[index_of(channel)];
    if (listener.declared > 0.0) continue;
    if (!frame.has(channel)) {
      listener.in_a_row = 0;
      continue;
    }
    const double now = frame[channel];
    auto& [a, b, c] = listener.last;
    const double largest = 1.0e3 * listener.size;
    if (listener.heard > 0.0 && std::abs(now) > largest) continue;  // an absurd reading
    listener.size = std::max(listener.size, std::abs(now));
    if (listener.in_a_row >= 3) {
      const double third = now - 3.0 * a + 3.0 * b - c;
      listener.heard = std::min(listener.heard + 1.0, std::max(10.0, noise_hearing_s / period_s_));
      listener.variance += (third * third / 20.0 - listener.variance) / listener.heard;
    }
    c = b;
    b = a;
    a = now;
    ++listener.in_a_row;
  }
}

void Noise::learn_drive(double normalised_innovation) {
  if (!std::isfinite(normalised_innovation)) return;  // the filter is lost, the drive is not
  // Innovations of a right filter are white: a trend in them says too tame, a contrary one too
  // wild.
  const double size = std::min(square(normalised_innovation) - 1.0, 20.0);
  const double trend = std::clamp(normalised_innovation * drive_trend_, -20.0, 20.0);
  drive_trend_ += -drive_trend_ * std::min(1.0, period_s_ / drive_trend_s) +
                  std::clamp(normalised_innovation, -5.0, 5.0);
  const double step = (size + trend) * period_s_ / drive_lesson_s;
  log_jerk_density_ = std::clamp(log_jerk_density_ + step, least_log_density_, most_log_density_);
}

double Noise::friction_level(const Vector& mean) const {
  const Layout& l = *layout_;
  if (l.mu < 0) return 0.0;
  const auto& structure = rig_->structure();
  double load = 1.0;
  if (structure.loaded) {
    load = l.load >= 0 ? std::abs(mean[l.load]) : numbers_->c.load;
    if (structure.load_law == physics::NormalLoadLaw::wedge) {
      load *= std::max(0.0, 1.0 + numbers_->c.load_slope * mean[l.rig[state::x]]);
    }
  }
  return std::abs(mean[l.mu]) * load;
}

// What the widened backbone leaves out: the variance of tanh over the doubt of the slip velocity,
// less what is linear in it.
double Noise::backbone_variance(const Vector& mean, double slip_variance) const {
  const Layout& l = *layout_;
  const double own = square(numbers_->c.transition_speed);
  const double wide = own + 0.5 * pi * slip_variance;
  const double slip = mean[l.rig[state::v]] - (l.rig[state::u] >= 0 ? mean[l.rig[state::u]] : 0.0);
  const double left = 1.0 - square(physics::quick_tanh(slip / std::sqrt(wide)));
  return jump_share *
         std::max(0.0, left * (wide - own) / wide - square(left) * slip_variance / wide);
}

double Noise::lesson(const Vector& mean, double slip_variance) const {
  const Layout& l = *layout_;
  const double slip = mean[l.rig[state::v]] - (l.rig[state::u] >= 0 ? mean[l.rig[state::u]] : 0.0);
  const double wide = square(numbers_->c.transition_speed) + 0.5 * pi * slip_variance;
  return square(physics::quick_tanh(square(slip) / (lesson_speeds * lesson_speeds * wide)));
}

void Noise::add_output(const Vector& mean, Covariance& covariance) const {
  const Layout& l = *layout_;
  if (l.theta < l.core) return;
  const double level = friction_level(mean);
  const double variance = square(backbone_doubt);
  covariance.add(l.theta, l.theta, variance);
  covariance.add(l.friction, l.friction, variance * square(level));
  covariance.add(l.theta, l.friction, variance * level);
}

void Noise::start(const Frame& frame, double mu, Vector& mean, Covariance& covariance) const {
  const Layout& l = *layout_;
  const auto& c = numbers_->c;
  const auto& structure = rig_->structure();
  const Channel driven = drive_channel(structure);
  const auto read = [&](Channel channel) { return frame.has(channel) ? frame[channel] : 0.0; };

  mean.setZero();
  covariance.set_zero();
  const auto set = [&](int index, double value, double deviation) {
    if (index < 0) return;
    mean[index] = value;
    covariance.set(index, index, square(deviation));
  };

  // Sizes of things, from the model and this frame.
  double load = c.load;
  if (l.load_rate >= 0) load = read(Channel::normal_load);
  if (!structure.loaded) load = 1.0;
  const double friction = structure.friction ? std::max(c.mu * std::abs(load), 1.0e-9) : 0.0;
  const double x = read(Channel::displacement);
  const double v = read(Channel::velocity);
  double length = std::max({std::abs(x), std::abs(v) / natural_rad_s_, 1.0e-4});
  if (structure.two_well) {
    length = std::max(length, std::sqrt(c.well_linear / std::max(c.well_cubic, 1.0e-12)));
  } else {
    length = std::max(length, friction / (c.mass * square(natural_rad_s_)));
  }
  if (structure.excitation == Excitation::base) length = std::max(length, std::abs(read(driven)));
  const double speed = length * natural_rad_s_;

  const bool sees_x = frame.has(Channel::displacement);
  const bool sees_v = frame.has(Channel::velocity);
  set(l.rig[state::x], x, sees_x ? 0.5 * length : 2.0 * length);
  set(l.rig[state::v], v, sees_v ? 0.5 * speed : 2.0 * speed);
  const double force = read(Channel::friction_force);
  if (structure.resonant) {
    const double cell_rad_s = std::sqrt(c.cell_stiffness / c.cell_mass);
    const double deflection = (friction + std::abs(force)) / c.cell_stiffness;
    set(l.rig[state::y], force / c.cell_stiffness, deflection);
    set(l.rig[state::u], 0.0, deflection * cell_rad_s);
  }
  const double theta = friction > 0.0 ? std::clamp(force / friction, -1.0, 1.0) : 0.0;
  if (structure.kinetics == Kinetics::bristle) {
    const double reach = friction / std::max(c.contact_stiffness, 1.0e-12);
    set(l.rig[state::contact], theta * reach, 0.5 * reach);
  } else {
    set(l.rig[state::contact], theta, 0.5);
  }
  for (int i = state::first_effect; i < physics::max_rig_states; ++i) {
    // States of effects are forces or deflections of their own: as large as the rig's own ones.
    set(l.rig[static_cast<std::size_t>(i)], 0.0,
        std::max(friction, c.mass * square(natural_rad_s_) * length));
  }
  if (l.mu >= 0) {
    const bool sane = mu > 0.1 * c.mu && mu < 10.0 * c.mu;
    const double doubt = std::max(model_->friction.mu.sigma, mu_doubt * c.mu);
    set(l.mu, sane ? mu : c.mu, doubt_at_start(doubt, learnt_doubt * c.mu));
  }
  if (l.log_rate >= 0) {
    const double doubt = std::min(1.0, relative(model_->friction.rate_per_s));
    set(l.log_rate, log_rate_, doubt_at_start(doubt, std::min(doubt, learnt_doubt)));
  }
  if (l.load_rate >= 0) {
    set(l.load, load, 0.5 * std::abs(load) + 1.0e-6);
    set(l.load_rate, 0.0, std::abs(load) * natural_rad_s_);
  } else if (l.load >= 0) {
    set(l.load, c.load, model_->normal_load->load_n.sigma);
  }

  const double p = read(driven);
  const double drive_size =
      structure.excitation == Excitation::base
          ? length
          : std::max({std::abs(p), friction, c.mass * square(natural_rad_s_) * length});
  const double drive_rad_s = std::max(natural_rad_s_, 2.0 * pi * 2.0);
  set(l.drive, p, frame.has(driven) ? drive_size : 3.0 * drive_size);
  set(l.drive + 1, 0.0, 2.0 * drive_size * drive_rad_s);
  set(l.drive + 2, 0.0, 2.0 * drive_size * square(drive_rad_s));
  set(l.drive + 3, square(drive_rad_s), square(drive_rad_s));

  set(l.friction, theta * friction, friction);
  if (l.theta >= l.core) set(l.theta, theta, 0.7);
  const auto remember = [&](Channel channel, double value, double value_doubt, double rate,
                            double rate_doubt) {
    const Chain& chain = l.of(channel);
    if (!chain.used) return;
    if (chain.hum >= 0) {
      set(chain.hum, 0.0, chain.hum_size);
      set(chain.hum + 1, 0.0, chain.hum_size);
    }
    set(chain.offset, 0.0, offset_memory_s * chain.offset_per_s);
    for (int k = 0; k < chain.delays; ++k) {
      set(chain.first_delay + 2 * k, value, value_doubt);
      set(chain.first_delay + 2 * k + 1, rate, rate_doubt);
    }
    if (chain.sections.empty()) {
      set(chain.reading, value, value_doubt);
      return;
    }
    int next = chain.first;
    for (const Section& section : chain.sections) {
      set(next++, value, value_doubt);
      if (section.second_order) set(next++, rate, rate_doubt);
    }
  };
  remember(Channel::displacement, x, length, v, speed);
  remember(Channel::velocity, v, speed, 0.0, 2.0 * speed * natural_rad_s_);
  const double force_size = friction + std::abs(force);
  remember(Channel::friction_force, force, force_size, 0.0, 100.0 * force_size);
  const double load_reading = frame.has(Channel::normal_load) ? frame[Channel::normal_load] : load;
  remember(Channel::normal_load, load_reading, 0.5 * std::abs(load) + 1.0e-6, 0.0,
           std::abs(load) * natural_rad_s_);
  remember(driven, p, drive_size, 0.0, 2.0 * drive_size * drive_rad_s);
}

void Noise::add_process(const Vector& mean, double slip_variance, double since_start_s,
                        double drive_variance, Covariance& covariance) const {
  const Layout& l = *layout_;
  const auto& c = numbers_->c;
  const auto& structure = rig_->structure();
  const double h = period_s_;
  const double colour = 2.0 * force_memory_s * h;  // white noise as strong as the coloured doubt
  const auto grow = [&](int index, double variance) {
    if (index >= 0) covariance.add(index, index, variance);
  };

  const double x = mean[l.rig[state::x]];
  const double v = mean[l.rig[state::v]];
  const double load = l.load >= 0 ? std::abs(mean[l.load]) : c.load;
  const double friction = friction_level(mean);
  const double jump = structure.friction && structure.kinetics != Kinetics::bristle
                          ? backbone_variance(mean, slip_variance)
                          : 0.0;
  const bool at_once = structure.kinetics == Kinetics::instantaneous;
  const double by_jump = at_once ? 2.0 * jump_memory_s * h * jump * square(friction) : 0.0;
  const double base_acceleration =
      structure.excitation == Excitation::base ? mean[l.drive + 2] : 0.0;
  const double on_mass = square(force_doubt * friction) + square(spring_doubt_n_m_ * x) +
                         square(damping_doubt_n_s_m_ * v) +
                         square(mass_doubt_kg_ * base_acceleration);
  grow(l.rig[state::v], (colour * on_mass + by_jump) / square(c.mass));
  if (structure.resonant) {
    const double y = mean[l.rig[state::y]];
    const double on_cell = square(force_doubt * friction) + square(cell_doubt_n_m_ * y);
    grow(l.rig[state::u], (colour * on_cell + by_jump) / square(c.cell_mass));
  }
  if (structure.kinetics == Kinetics::relaxing) {
    const double rate = l.log_rate >= 0 ? std::exp(mean[l.log_rate]) : c.rate;
    // Behind a fast rate theta is g, and so is its doubt.
    const double share = 1.0 - std::exp(-rate * h);
    grow(l.rig[state::contact],
         square(share) * (square(backbone_doubt) * std::max(1.0, 2.0 * force_memory_s / h) +
                          jump * std::max(1.0, 2.0 * jump_memory_s / h)));
  }
  if (structure.kinetics == Kinetics::bristle && structure.friction) {
    const double reach = friction / std::max(c.contact_stiffness, 1.0e-12);
    grow(l.rig[state::contact], square(backbone_doubt * reach) * h / force_memory_s);
  }
  for (int i = state::first_effect; i < physics::max_rig_states; ++i) {
    const double size = std::max(friction, c.stiffness * std::abs(x));
    grow(l.rig[static_cast<std::size_t>(i)], square(force_doubt * size) * h / force_memory_s);
  }
  const bool restive = contact_ == Contact::to_be_learnt && since_start_s < 30.0 * restless_s;
  const double restless = restive ? std::exp(-since_start_s / restless_s) / restless_s : 0.0;
  const bool walks = contact_ != Contact::known;
  if (l.mu >= 0 && walks) {
    grow(l.mu, square(c.mu) * (square(mu_walk) + square(mu_restlessness) * restless) * h);
  }
  if (l.log_rate >= 0 && walks) {
    grow(l.log_rate, (square(rate_walk) + square(rate_restlessness) * restless) * h);
  }
  if (l.load_rate >= 0) {
    grow(l.load, square(load_walk * load) * h);
    grow(l.load_rate, square(load_rate_walk * load) * h);
  } else if (l.load >= 0) {
    grow(l.load, square(load_walk * c.load) * h * 0.01);
  }

  if (l.behind_chains < l.count) {
    for (const Chain& chain : l.chain) {
      if (chain.hum >= 0) {  // as much as it forgets
        grow(chain.hum, square(chain.hum_size) * 2.0 * h / hum_memory_s);
        grow(chain.hum + 1, square(chain.hum_size) * 2.0 * h / hum_memory_s);
      }
      grow(chain.offset, square(chain.offset_per_s) * offset_memory_s * h);
    }
  }

  // The drive: p''' is white noise of that density.
  const double q = std::exp(log_jerk_density_) * drive_variance * h;
  const int p = l.drive;
  const auto pair = [&](int i, int j, double value) { covariance.add(p + i, p + j, value); };
  pair(0, 0, q * h * h * h * h * h / 20.0);
  pair(0, 1, q * h * h * h * h / 8.0);
  pair(0, 2, q * h * h * h / 6.0);
  pair(1, 1, q * h * h * h / 3.0);
  pair(1, 2, q * h * h / 2.0);
  pair(2, 2, q * h);
  const double lambda = std::max(mean[p + 3], square(2.0 * pi * 0.5));
  if (covariance(p + 3, p + 3) < square(lambda)) {
    grow(p + 3, square(2.0 * frequency_walk * lambda) * h);
  }
}

double Noise::doubt_at_start(double unlearnt, double learnt) const {
  switch (contact_) {
    case Contact::known:
      return 0.0;
    case Contact::learnt:
      return learnt;
    case Contact::to_be_learnt:
      break;
  }
  return unlearnt;
}

bool Noise::is_absurd(const Vector& mean) const {
  const Layout& l = *layout_;
  const auto& c = numbers_->c;
  const bool mu = l.mu >= 0 && (mean[l.mu] < absurd_mu * c.mu || mean[l.mu] * absurd_mu > c.mu);
  const bool rate = l.log_rate >= 0 && std::abs(mean[l.log_rate] - log_rate_) > absurd_log;
  return mu || rate;
}

void Noise::confine(Vector& mean) const {
  const Layout& l = *layout_;
  const auto& c = numbers_->c;
  if (l.mu >= 0) mean[l.mu] = std::max(mean[l.mu], 1.0e-3 * c.mu);
  if (l.log_rate >= 0) {
    mean[l.log_rate] = std::clamp(mean[l.log_rate], log_rate_ - 4.0, log_rate_ + 4.0);
  }
  if (l.load >= 0 && l.load_rate < 0) mean[l.load] = std::max(mean[l.load], 1.0e-3 * c.load);
  mean[l.drive + 3] = std::clamp(mean[l.drive + 3], 0.0, square(most_drive_rad_s));
}

}  // namespace stickslip::observer
