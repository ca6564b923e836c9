// SPDX-License-Identifier: Apache-2.0
#include "observer/noise.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "observer/chain_memory.h"
#include "observer/sensor_error_states.h"
#include "physics/backbone.h"
#include "physics/friction_laws.h"

namespace stickslip::observer {

namespace {

using physics::Excitation;
using physics::Kinetics;
using physics::Parameter;
namespace state = physics::state;
using std::numbers::pi;

double square(double x) { return x * x; }

// Unmodelled forces: share of mu N and of the spring's force, correlated over force_memory_s.
constexpr double force_share = 0.002;
constexpr double spring_share = 0.0005;
constexpr double force_memory_s = 0.01;
// Random walks of the parameters, relative, per root of a second.
constexpr double mu_walk = 0.0005;
constexpr double rate_walk = 0.005;
constexpr double load_walk = 0.002;
constexpr double frequency_walk = 0.05;
// While the motion is still converging, estimates of mu and gamma become overconfident: their walks
// are larger at the start by these relative amounts, with this decay time.
constexpr double startup_s = 1.5;
constexpr double mu_startup_walk = 0.2;
constexpr double rate_startup_walk = 0.3;
// Relative standard deviation of mu at the start where none is declared, and of parameters that
// were estimated from the same recording before.
constexpr double mu_initial_std = 0.3;
constexpr double recording_initial_std = 0.05;
// Limits of plausible parameters: share of the model's mu, logarithm of the ratio of gamma.
constexpr double implausible_mu = 1.0 / 30.0;
constexpr double implausible_log_rate = 3.5;
// Largest frequency of the drive.
constexpr double max_drive_rad_s = 2.0 * pi * 40.0;
// Correlation time of the backbone's error due to the uncertain slip velocity.
constexpr double jump_memory_s = 5.0e-4;
// Share of that error that the next readings do not correct; tuned with observer_campaign.
constexpr double jump_share = 0.1;
// Slip velocity above which mu is observable, in widened transition speeds.
constexpr double sliding_speeds = 2.0;
constexpr double noise_memory_s = 1.0;
// Correlation time of an offset, over which it walks as far as it drifts.
constexpr double offset_memory_s = 10.0;

double relative(const Parameter& p) { return p.value != 0.0 ? std::abs(p.sigma / p.value) : 0.0; }

}  // namespace

NoiseModel::NoiseModel(const physics::Model& model, const physics::Rig& rig, const Layout& layout,
                       const physics::RigNumbers<double>& numbers, double period_s,
                       FrictionPrior prior)
    : model_(&model),
      rig_(&rig),
      layout_(&layout),
      numbers_(&numbers),
      period_s_(period_s),
      prior_(prior),
      drive_noise_(3, period_s),
      load_noise_(2, period_s) {
  const auto& c = numbers.c;
  const double stiffness = rig.structure().two_well ? 2.0 * c.well_linear : c.stiffness;
  log_rate_ = std::log(std::max(c.rate, 1.0e-300));
  natural_rad_s_ = std::max(std::sqrt(stiffness / c.mass), 2.0 * pi * 0.5);
  // Of a two-well oscillator near its wells.
  spring_std_n_m_ = spring_share * stiffness;
  cell_std_n_m_ = model.load_cell ? spring_share * c.cell_stiffness : 0.0;
  for (Channel channel : all_channels) {
    const auto& declared = model.sensors[index_of(channel)].noise_std;
    reading_noise_[index_of(channel)].declared = declared ? square(*declared) : 0.0;
  }
  const physics::Structure& structure = rig.structure();
  if (structure.friction && structure.kinetics == Kinetics::instantaneous && !structure.resonant) {
    find_force_response(model);
  }
}

void NoiseModel::find_force_response(const physics::Model& model) {
  const Chain& chain = layout_->of(Channel::friction_force);
  if (!chain.used) return;
  const physics::FilterChain filters(model.sensors[index_of(Channel::friction_force)].filters,
                                     period_s_);
  physics::FilterMemory<double> memory;
  memory.input = 1.0;
  filters.advance(memory, 1.0, 0.0);
  for_each_state(chain, filters, memory, [this](int state, double value) {
    force_response_.push_back({state, value});
  });
}

double NoiseModel::reading_variance(Channel channel) const {
  const ReadingNoise& noise = reading_noise_[index_of(channel)];
  if (noise.declared > 0.0) return noise.declared;
  const double floor = square(1.0e-4 * noise.largest) + 1.0e-24;
  if (noise.count == 0.0) return square(0.02 * noise.largest) + floor;
  return std::max(noise.variance, floor);
}

void NoiseModel::continue_from(const NoiseModel& before) {
  for (std::size_t i = 0; i < channel_count; ++i) {
    const double declared = reading_noise_[i].declared;
    reading_noise_[i] = before.reading_noise_[i];
    reading_noise_[i].declared = declared;
  }
  drive_noise_ = before.drive_noise_;
  load_noise_ = before.load_noise_;
}

// Behind an anti-aliasing filter the third difference of a reading is noise alone, with 20 times
// its variance. Without one the noise is overestimated, which is conservative.
void NoiseModel::estimate_reading_noise(const Frame& frame) {
  for (Channel channel : all_channels) {
    ReadingNoise& noise = reading_noise_[index_of(channel)];
    if (noise.declared > 0.0) continue;
    if (!frame.has(channel)) {
      noise.in_a_row = 0;
      continue;
    }
    const double now = frame[channel];
    auto& [a, b, c] = noise.last;
    const double limit = 1.0e3 * noise.largest;
    if (noise.count > 0.0 && std::abs(now) > limit) continue;  // an outlier
    noise.largest = std::max(noise.largest, std::abs(now));
    if (noise.in_a_row >= 3) {
      const double third = now - 3.0 * a + 3.0 * b - c;
      noise.count = std::min(noise.count + 1.0, std::max(10.0, noise_memory_s / period_s_));
      noise.variance += (third * third / 20.0 - noise.variance) / noise.count;
    }
    c = b;
    b = a;
    a = now;
    ++noise.in_a_row;
  }
}

void NoiseModel::adapt_input_noise(Channel channel, double normalised_innovation) {
  const Channel driven = drive_channel(rig_->structure());
  if (channel == driven) drive_noise_.adapt(normalised_innovation);
  // Of an imposed motion.
  if (driven == Channel::displacement && channel == Channel::velocity) {
    drive_noise_.adapt(normalised_innovation, 1);
  }
  if (channel == Channel::normal_load) load_noise_.adapt(normalised_innovation);
}

double NoiseModel::sliding_friction(const Vector& mean) const {
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

// Variance that the widened backbone neglects: that of tanh over the distribution of the slip
// velocity, minus its linear part. For a transition speed of 0 the variance is that of a sign, and
// the mean an error function, of which the tanh is an approximation.
double NoiseModel::backbone_variance(const Vector& mean, double slip_variance) const {
  const Layout& l = *layout_;
  const double own = square(numbers_->c.transition_speed);
  const double wide = own + 0.5 * pi * slip_variance;
  const double slip = mean[l.rig[state::v]] - (l.rig[state::u] >= 0 ? mean[l.rig[state::u]] : 0.0);
  const double left = 1.0 - square(physics::quick_tanh(slip / std::sqrt(wide)));
  const double mean_sign = std::erf(0.5 * std::sqrt(pi / wide) * slip);
  const double variance = (1.0 - square(mean_sign)) * (wide - own) / wide;
  return std::max(0.0, variance - square(left) * slip_variance / wide);
}

double NoiseModel::mu_gain_factor(const Vector& mean, double slip_variance) const {
  const Layout& l = *layout_;
  const double slip = mean[l.rig[state::v]] - (l.rig[state::u] >= 0 ? mean[l.rig[state::u]] : 0.0);
  const double wide = square(numbers_->c.transition_speed) + 0.5 * pi * slip_variance;
  return square(physics::quick_tanh(square(slip) / (sliding_speeds * sliding_speeds * wide)));
}

void NoiseModel::add_output_noise(const Vector& mean, double slip_variance,
                                  Covariance& covariance) const {
  const Layout& l = *layout_;
  if (l.theta < l.core) return;
  const double level = sliding_friction(mean);
  const double lasting = square(backbone_std);
  const double jump = rig_->structure().kinetics == Kinetics::instantaneous
                          ? backbone_variance(mean, slip_variance)
                          : 0.0;
  const double variance = lasting + jump;
  covariance.add(l.theta, l.theta, variance);
  covariance.add(l.friction, l.friction, variance * square(level));
  covariance.add(l.theta, l.friction, variance * level);
  // White noise equivalent to the coloured one.
  const double in_chain = lasting * std::max(1.0, 2.0 * force_memory_s / period_s_) + jump;
  for (std::size_t i = 0; i < force_response_.size(); ++i) {
    const auto& [state, value] = force_response_[i];
    covariance.add(l.theta, state, variance * level * value);
    covariance.add(l.friction, state, variance * square(level) * value);
    for (std::size_t j = 0; j <= i; ++j) {
      covariance.add(force_response_[j].state, state,
                     in_chain * square(level) * value * force_response_[j].value);
    }
  }
}

/// Sets initial values with independent standard deviations.
class NoiseModel::InitialState {
 public:
  InitialState(Vector& mean, Covariance& covariance) : mean_(mean), covariance_(covariance) {
    mean_.setZero();
    covariance_.set_zero();
  }
  void set(int index, double value, double deviation) {
    if (index < 0) return;
    mean_[index] = value;
    covariance_.set(index, index, square(deviation));
  }

 private:
  Vector& mean_;
  Covariance& covariance_;
};

namespace {

double reading_or_zero(const Frame& frame, Channel channel) {
  return frame.has(channel) ? frame[channel] : 0.0;
}

}  // namespace

NoiseModel::Scales NoiseModel::scales(const Frame& frame) const {
  const auto& c = numbers_->c;
  const auto& structure = rig_->structure();
  Scales out;
  out.load = c.load;
  if (layout_->load_rate >= 0) out.load = reading_or_zero(frame, Channel::normal_load);
  if (!structure.loaded) out.load = 1.0;
  out.load_std =
      0.5 * std::abs(out.load) + 10.0 * std::sqrt(reading_variance(Channel::normal_load));
  out.friction = structure.friction ? std::max(c.mu * std::abs(out.load), 1.0e-9) : 0.0;
  const double x = reading_or_zero(frame, Channel::displacement);
  const double v = reading_or_zero(frame, Channel::velocity);
  double length = std::max({std::abs(x), std::abs(v) / natural_rad_s_, 1.0e-4});
  if (structure.two_well) {
    length = std::max(length, std::sqrt(c.well_linear / std::max(c.well_cubic, 1.0e-12)));
  } else {
    length = std::max(length, out.friction * numbers_->inverse_mass / square(natural_rad_s_));
  }
  const double p = reading_or_zero(frame, drive_channel(structure));
  if (structure.excitation == Excitation::base) length = std::max(length, std::abs(p));
  out.length = length;
  out.speed = length * natural_rad_s_;
  out.drive = structure.excitation != Excitation::force
                  ? length
                  : std::max({std::abs(p), out.friction, c.mass * square(natural_rad_s_) * length});
  out.drive_rad_s = std::max(natural_rad_s_, 2.0 * pi * 2.0);
  return out;
}

void NoiseModel::initialise_rig(const Frame& frame, const Scales& scale, InitialState& out) const {
  const Layout& l = *layout_;
  const auto& c = numbers_->c;
  const auto& structure = rig_->structure();
  const bool has_x = frame.has(Channel::displacement);
  const bool has_v = frame.has(Channel::velocity);
  out.set(l.rig[state::x], reading_or_zero(frame, Channel::displacement),
          has_x ? 0.5 * scale.length : 2.0 * scale.length);
  out.set(l.rig[state::v], reading_or_zero(frame, Channel::velocity),
          has_v ? 0.5 * scale.speed : 2.0 * scale.speed);
  const double force = reading_or_zero(frame, Channel::friction_force);
  if (structure.resonant) {
    const double cell_rad_s = std::sqrt(c.cell_stiffness / c.cell_mass);
    const double deflection = (scale.friction + std::abs(force)) / c.cell_stiffness;
    out.set(l.rig[state::y], force / c.cell_stiffness, deflection);
    out.set(l.rig[state::u], 0.0, deflection * cell_rad_s);
  }
  const double theta = scale.friction > 0.0 ? std::clamp(force / scale.friction, -1.0, 1.0) : 0.0;
  if (structure.kinetics == Kinetics::bristle) {
    const double reach = scale.friction / std::max(c.contact_stiffness, 1.0e-12);
    out.set(l.rig[state::contact], theta * reach, 0.5 * reach);
  } else if (structure.kinetics == Kinetics::ageing) {
    out.set(l.rig[state::contact], 0.0, 3.0);  // the logarithm of an age
  } else {
    out.set(l.rig[state::contact], theta, 0.5);
  }
  for (int i = state::first_effect; i < physics::max_rig_states; ++i) {
    // States of effects are forces or deflections, of the magnitude of the rig's own.
    out.set(l.rig[static_cast<std::size_t>(i)], 0.0,
            std::max(scale.friction, c.mass * square(natural_rad_s_) * scale.length));
  }
  const Channel driven = drive_channel(structure);
  out.set(l.drive, reading_or_zero(frame, driven),
          frame.has(driven) ? scale.drive : 3.0 * scale.drive);
  out.set(l.drive + 1, 0.0, 2.0 * scale.drive * scale.drive_rad_s);
  out.set(l.drive + 2, 0.0, 2.0 * scale.drive * square(scale.drive_rad_s));
  out.set(l.drive + 3, square(scale.drive_rad_s), square(scale.drive_rad_s));
  out.set(l.friction, theta * scale.friction, scale.friction);
  if (l.theta >= l.core) out.set(l.theta, theta, 0.7);
}

void NoiseModel::initialise_parameters(double mu, const Scales& scale, InitialState& out) const {
  const Layout& l = *layout_;
  const auto& c = numbers_->c;
  if (l.mu >= 0) {
    const bool plausible = mu > 0.1 * c.mu && mu < 10.0 * c.mu;
    const double declared = physics::friction_coefficient(*model_).sigma;
    const double deviation = declared > 0.0 ? declared : mu_initial_std * c.mu;
    out.set(l.mu, plausible ? mu : c.mu,
            initial_deviation(deviation, recording_initial_std * c.mu));
  }
  if (l.log_rate >= 0) {
    const double deviation = std::min(1.0, relative(model_->friction.rate_per_s));
    out.set(l.log_rate, log_rate_,
            initial_deviation(deviation, std::min(deviation, recording_initial_std)));
  }
  if (l.load_rate >= 0) {
    out.set(l.load, scale.load, scale.load_std);
    out.set(l.load_rate, 0.0, 2.0 * scale.load_std * natural_rad_s_);
  } else if (l.load >= 0) {
    out.set(l.load, c.load, model_->normal_load->load_n.sigma);
  }
}

void NoiseModel::initialise_chains(const Frame& frame, const Scales& scale,
                                   InitialState& out) const {
  const auto initialise = [&](Channel channel, double value, double value_std, double rate,
                              double rate_std) {
    const Chain& chain = layout_->of(channel);
    if (!chain.used) return;
    if (chain.hum >= 0) {
      out.set(chain.hum, 0.0, chain.hum_amplitude);
      out.set(chain.hum + 1, 0.0, chain.hum_amplitude);
    }
    out.set(chain.offset, 0.0, offset_memory_s * chain.drift_per_s);
    for (int k = 0; k < chain.delays; ++k) {
      out.set(chain.first_delay + 2 * k, value, value_std);
      out.set(chain.first_delay + 2 * k + 1, rate, rate_std);
    }
    if (chain.count == 0) return;
    if (chain.sections.empty()) {
      out.set(chain.reading, value, value_std);
      return;
    }
    int next = chain.first;
    for (const Section& section : chain.sections) {
      out.set(next++, value, value_std);
      if (section.second_order) out.set(next++, rate, rate_std);
    }
  };
  const double v = reading_or_zero(frame, Channel::velocity);
  initialise(Channel::displacement, reading_or_zero(frame, Channel::displacement), scale.length, v,
             scale.speed);
  initialise(Channel::velocity, v, scale.speed, 0.0, 2.0 * scale.speed * natural_rad_s_);
  const double force = reading_or_zero(frame, Channel::friction_force);
  const double force_std = scale.friction + std::abs(force);
  initialise(Channel::friction_force, force, force_std, 0.0, 100.0 * force_std);
  const double load = frame.has(Channel::normal_load) ? frame[Channel::normal_load] : scale.load;
  initialise(Channel::normal_load, load, scale.load_std, 0.0,
             2.0 * scale.load_std * natural_rad_s_);
  const Channel driven = drive_channel(rig_->structure());
  initialise(driven, reading_or_zero(frame, driven), scale.drive, 0.0,
             2.0 * scale.drive * scale.drive_rad_s);
}

void NoiseModel::initialise(const Frame& frame, double mu, Vector& mean,
                            Covariance& covariance) const {
  const Scales scale = scales(frame);
  InitialState out(mean, covariance);
  initialise_rig(frame, scale, out);
  initialise_parameters(mu, scale, out);
  initialise_chains(frame, scale, out);
}

namespace {

void add_variance(Covariance& covariance, int index, double variance) {
  if (index >= 0) covariance.add(index, index, variance);
}

}  // namespace

void NoiseModel::add_force_noise(const Vector& mean, double slip_variance,
                                 Covariance& covariance) const {
  const Layout& l = *layout_;
  const auto& c = numbers_->c;
  const auto& structure = rig_->structure();
  const double h = period_s_;
  const double colour = 2.0 * force_memory_s * h;  // white noise equivalent to the coloured one
  const double x = mean[l.rig[state::x]];
  const double friction = sliding_friction(mean);
  const double jump = structure.friction && structure.kinetics != Kinetics::bristle
                          ? jump_share * backbone_variance(mean, slip_variance)
                          : 0.0;
  const bool instantaneous = structure.kinetics == Kinetics::instantaneous;
  const double by_jump = instantaneous ? 2.0 * jump_memory_s * h * jump * square(friction) : 0.0;
  const double on_mass = square(force_share * friction) + square(spring_std_n_m_ * x);
  add_variance(covariance, l.rig[state::v],
               (colour * on_mass + by_jump) * square(numbers_->inverse_mass));
  if (structure.resonant) {
    const double y = mean[l.rig[state::y]];
    const double on_cell = square(force_share * friction) + square(cell_std_n_m_ * y);
    add_variance(covariance, l.rig[state::u], (colour * on_cell + by_jump) / square(c.cell_mass));
  }
  if (structure.kinetics == Kinetics::relaxing) {
    const double rate = l.log_rate >= 0 ? std::exp(mean[l.log_rate]) : c.rate;
    // For a fast rate theta equals g, and so does its uncertainty.
    const double share = 1.0 - std::exp(-rate * h);
    add_variance(covariance, l.rig[state::contact],
                 square(share) * (square(backbone_std) * std::max(1.0, 2.0 * force_memory_s / h) +
                                  jump * std::max(1.0, 2.0 * jump_memory_s / h)));
  }
  if (structure.kinetics == Kinetics::bristle && structure.friction) {
    const double reach = friction / std::max(c.contact_stiffness, 1.0e-12);
    add_variance(covariance, l.rig[state::contact],
                 square(backbone_std * reach) * h / force_memory_s);
  }
  for (int i = state::first_effect; i < physics::max_rig_states; ++i) {
    const double size = std::max(friction, c.stiffness * std::abs(x));
    add_variance(covariance, l.rig[static_cast<std::size_t>(i)],
                 square(force_share * size) * h / force_memory_s);
  }
}

void NoiseModel::add_parameter_noise(double since_start_s, Covariance& covariance) const {
  const Layout& l = *layout_;
  const auto& c = numbers_->c;
  const double h = period_s_;
  const bool starting = prior_ == FrictionPrior::from_model && since_start_s < 30.0 * startup_s;
  const double startup = starting ? std::exp(-since_start_s / startup_s) / startup_s : 0.0;
  if (l.mu >= 0) {
    add_variance(covariance, l.mu,
                 square(c.mu) * (square(mu_walk) + square(mu_startup_walk) * startup) * h);
  }
  if (l.log_rate >= 0) {
    add_variance(covariance, l.log_rate,
                 (square(rate_walk) + square(rate_startup_walk) * startup) * h);
  }
  if (l.load >= 0 && l.load_rate < 0) {
    add_variance(covariance, l.load, square(load_walk * c.load) * h * 0.01);
  }
}

void NoiseModel::add_sensor_error_noise(Covariance& covariance) const {
  const double h = period_s_;
  for (const Chain& chain : layout_->chain) {
    if (chain.hum >= 0) {  // balances the damping of the hum
      const double variance = square(chain.hum_amplitude) * 2.0 * h / hum_memory_s;
      add_variance(covariance, chain.hum, variance);
      add_variance(covariance, chain.hum + 1, variance);
    }
    add_variance(covariance, chain.offset, square(chain.drift_per_s) * offset_memory_s * h);
  }
}

// The third derivative of p is white noise.
void NoiseModel::add_drive_noise(const Vector& mean, double variance,
                                 Covariance& covariance) const {
  const double h = period_s_;
  const double q = drive_noise_.per_period() * variance;
  const int p = layout_->drive;
  covariance.add(p, p, q * h * h * h * h * h / 20.0);
  covariance.add(p, p + 1, q * h * h * h * h / 8.0);
  covariance.add(p, p + 2, q * h * h * h / 6.0);
  covariance.add(p + 1, p + 1, q * h * h * h / 3.0);
  covariance.add(p + 1, p + 2, q * h * h / 2.0);
  covariance.add(p + 2, p + 2, q * h);
  const double lambda = std::max(mean[p + 3], square(2.0 * pi * 0.5));
  if (covariance(p + 3, p + 3) < square(lambda)) {
    add_variance(covariance, p + 3, square(2.0 * frequency_walk * lambda) * h);
  }
}

// The second derivative of a measured load is white noise. Its size is that of the load's past
// changes, not of the load, which may reach zero.
void NoiseModel::add_load_noise(double variance, Covariance& covariance) const {
  const double h = period_s_;
  const double q = load_noise_.per_period() * variance;
  const int rate = layout_->load_rate;
  covariance.add(layout_->load, layout_->load, q * h * h / 3.0);
  covariance.add(layout_->load, rate, q * h / 2.0);
  covariance.add(rate, rate, q);
}

void NoiseModel::add_process_noise(const Vector& mean, double slip_variance, double since_start_s,
                                   const InputVariances& readings, Covariance& covariance) const {
  add_force_noise(mean, slip_variance, covariance);
  add_parameter_noise(since_start_s, covariance);
  if (layout_->first_sensor_error < layout_->count) add_sensor_error_noise(covariance);
  add_drive_noise(mean, readings.drive, covariance);
  if (layout_->load_rate >= 0) add_load_noise(readings.load, covariance);
}

double NoiseModel::initial_deviation(double from_model, double from_recording) const {
  return prior_ == FrictionPrior::from_recording ? from_recording : from_model;
}

bool NoiseModel::is_implausible(const Vector& mean) const {
  const Layout& l = *layout_;
  const auto& c = numbers_->c;
  const bool mu =
      l.mu >= 0 && (mean[l.mu] < implausible_mu * c.mu || mean[l.mu] * implausible_mu > c.mu);
  const bool rate =
      l.log_rate >= 0 && std::abs(mean[l.log_rate] - log_rate_) > implausible_log_rate;
  return mu || rate;
}

void NoiseModel::constrain(Vector& mean) const {
  const Layout& l = *layout_;
  const auto& c = numbers_->c;
  if (l.mu >= 0) mean[l.mu] = std::max(mean[l.mu], 1.0e-3 * c.mu);
  if (l.log_rate >= 0) {
    mean[l.log_rate] = std::clamp(mean[l.log_rate], log_rate_ - 4.0, log_rate_ + 4.0);
  }
  if (l.load >= 0 && l.load_rate < 0) mean[l.load] = std::max(mean[l.load], 1.0e-3 * c.load);
  mean[l.drive + 3] = std::clamp(mean[l.drive + 3], 0.0, square(max_drive_rad_s));
}

}  // namespace stickslip::observer
