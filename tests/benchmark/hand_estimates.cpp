// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/hand_estimates.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "diagnosis/wide_band.h"
#include "physics/rig.h"
#include "physics/sensor_chain.h"
#include "tests/benchmark/estimate_statistics.h"

namespace stickslip::quality {

namespace {

using physics::RigTruth;
using Values = std::vector<double>;

constexpr double end_s = 0.25;
constexpr double least_load = 0.05;  // of the mean load, for a ratio
// Butterworth, fourth order; the last candidate is no low-pass at all.
constexpr std::array<double, 11> cutoffs_hz = {3.0,  5.0,  8.0,  12.0,  18.0, 27.0,
                                               40.0, 60.0, 90.0, 135.0, 200.0};

Values lowpassed(const Values& values, const physics::FilterChain& chain) {
  Values out;
  out.reserve(values.size());
  physics::FilterMemory<double> memory;
  chain.settle(memory, values.front(), 0.0);
  for (const double value : values) {
    chain.advance(memory, value, 0.0);
    out.push_back(chain.output(memory));
  }
  return out;
}

// Forwards and backwards: no phase.
Values lowpassed_without_phase(Values values, const physics::FilterChain& chain) {
  for (int pass = 0; pass < 2; ++pass) {
    values = lowpassed(values, chain);
    std::reverse(values.begin(), values.end());
  }
  return values;
}

Values difference(const Values& values, double period_s) {
  Values out(values.size(), 0.0);
  for (std::size_t k = 1; k < values.size(); ++k) out[k] = (values[k] - values[k - 1]) / period_s;
  return out;
}

// Adds `factor` times the term.
void add(Values& sum, double factor, const Values& term) {
  for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += factor * term[k];
}

// A position with its derivatives.
struct Motion {
  Values value, rate, acceleration;
};

class Laboratory {
 public:
  Laboratory(const protocol::Recording& recording, const physics::Model& model,
             std::span<const RigTruth> truth, double sticking_below_m_s);

  HandErrors causal();
  /// After causal(), whose estimates count as well.
  HandErrors best();

 private:
  bool has(Channel channel) const { return !read_[index_of(channel)].empty(); }
  const Values& read(Channel channel) const { return read_[index_of(channel)]; }

  std::vector<physics::FilterChain> lowpasses() const;
  Motion inverted(Channel channel, double noise_share) const;
  Values inertial_base(const Values& acceleration, double mass) const;
  Values balance(const Motion& mass, const Values& base_acceleration) const;
  std::vector<Values> loads(bool invert) const;

  void offer_force(const Values& force, const std::vector<Values>& loads);
  std::optional<double> theta_error(const Values& force, const Values& load) const;
  void offer_slip(const Values& slip);
  std::vector<Values> force_candidates(const Values& base_acceleration) const;
  std::vector<Motion> mass_candidates() const;

  const physics::Model& model_;
  physics::Coefficients<double> c_;
  std::span<const RigTruth> truth_;
  double sticking_below_m_s_;
  double period_s_;
  std::size_t begin_, end_;  // of the frames that count
  std::array<Values, channel_count> read_;
  Values velocity_;  ///< of the estimate in progress
  HandErrors found_;
};

Laboratory::Laboratory(const protocol::Recording& recording, const physics::Model& model,
                       std::span<const RigTruth> truth, double sticking_below_m_s)
    : model_(model),
      truth_(truth),
      sticking_below_m_s_(sticking_below_m_s),
      period_s_(protocol::median_period_s(recording.frames)) {
  const physics::Rig rig(model);
  c_ = rig.numbers<double>(rig.parameter_values()).c;
  const std::size_t count = recording.frames.size();
  begin_ = std::min(count, static_cast<std::size_t>(end_s / period_s_));
  end_ = std::max(begin_, count - begin_);
  for (const Channel channel : all_channels) {
    if (!recording.frames.front().has(channel)) continue;
    Values& values = read_[index_of(channel)];
    for (const Frame& frame : recording.frames) values.push_back(frame[channel]);
  }
}

std::vector<physics::FilterChain> Laboratory::lowpasses() const {
  std::vector<physics::FilterChain> out;
  for (const double cutoff_hz : cutoffs_hz) {
    if (cutoff_hz * period_s_ > 0.4) continue;
    const physics::Filter filter{physics::FilterKind::butterworth_lowpass, 4, {cutoff_hz}};
    out.emplace_back(std::span(&filter, 1), period_s_);
  }
  out.emplace_back();
  return out;
}

// The channel before its filters. `noise_share` 0: no frequency is attenuated for its noise.
Motion Laboratory::inverted(Channel channel, double noise_share) const {
  const physics::Sensor& sensor = model_.sensors[index_of(channel)];
  std::vector<physics::Filter> filters;
  if (channel == Channel::velocity) {
    filters = model_.sensors[index_of(Channel::displacement)].filters;
  }
  filters.insert(filters.end(), sensor.filters.begin(), sensor.filters.end());
  const physics::FilterChain chain(filters, period_s_);
  const Values& values = read(channel);
  const double noise = sensor.noise_std.value_or(diagnosis::noise_of(values));
  diagnosis::WideBand out = diagnosis::wide_band(values, period_s_, chain, noise_share * noise);
  return {std::move(out.value), std::move(out.rate), std::move(out.acceleration)};
}

// m b'', 0 where the base does not move.
Values Laboratory::inertial_base(const Values& acceleration, double mass) const {
  Values out(truth_.size(), 0.0);
  if (!acceleration.empty()) add(out, mass, acceleration);
  return out;
}

// The friction force that the force balance of the mass leaves.
Values Laboratory::balance(const Motion& mass, const Values& base_acceleration) const {
  Values force = inertial_base(base_acceleration, -c_.mass);
  if (has(Channel::drive_force)) add(force, 1.0, read(Channel::drive_force));
  add(force, -c_.mass, mass.acceleration);
  add(force, -c_.damping, mass.rate);
  const bool wells = model_.oscillator.two_well.has_value();
  for (std::size_t k = 0; k < force.size(); ++k) {
    const double x = mass.value[k];
    force[k] -= wells ? (-c_.well_linear + c_.well_cubic * x * x) * x : c_.stiffness * x;
  }
  return force;
}

// The recorded normal load, and that of the model.
std::vector<Values> Laboratory::loads(bool invert) const {
  std::vector<Values> out;
  if (!model_.normal_load) return {Values(truth_.size(), 1.0)};
  if (has(Channel::normal_load)) {
    out.push_back(invert ? inverted(Channel::normal_load, 1.0).value : read(Channel::normal_load));
  }
  if (model_.normal_load->law == physics::NormalLoadLaw::measured) return out;
  Values declared =
      invert ? inverted(Channel::displacement, 1.0).value : read(Channel::displacement);
  for (double& x : declared) x = std::max(0.0, c_.load * (1.0 + c_.load_slope * x));
  out.push_back(std::move(declared));
  return out;
}

void keep_smaller(std::optional<double>& kept, const std::optional<double>& value) {
  if (value && (!kept || *value < *kept)) kept = value;
}

std::optional<double> Laboratory::theta_error(const Values& force, const Values& load) const {
  double mean = 0.0;
  for (const double each : load) mean += each / static_cast<double>(load.size());
  RelativeError error;
  for (std::size_t k = begin_; k < end_; ++k) {
    const double ratio = load[k] > least_load * mean && c_.mu > 0.0
                             ? force[k] / (c_.mu * load[k])
                             : std::copysign(1.0, velocity_[k]);
    error.add(std::clamp(ratio, -1.0, 1.0), truth_[k].theta);
  }
  return error.value();
}

void Laboratory::offer_force(const Values& force, const std::vector<Values>& loads) {
  RelativeError error;
  for (std::size_t k = begin_; k < end_; ++k) error.add(force[k], truth_[k].friction_force_n);
  keep_smaller(found_.force, error.value());
  for (const Values& load : loads) keep_smaller(found_.theta, theta_error(force, load));
}

void Laboratory::offer_slip(const Values& slip) {
  RelativeError error;
  std::vector<Scored> samples;
  for (std::size_t k = begin_; k < end_; ++k) {
    error.add(slip[k], truth_[k].slip_velocity_m_s);
    samples.push_back(
        {-std::abs(slip[k]), std::abs(truth_[k].slip_velocity_m_s) < sticking_below_m_s_});
  }
  keep_smaller(found_.slip, error.value());
  const std::optional<double> auc = area_under_curve(std::move(samples));
  if (auc && (!found_.auc || *auc > *found_.auc)) found_.auc = auc;
}

HandErrors Laboratory::causal() {
  const std::vector<Values> loads = this->loads(false);
  velocity_ = has(Channel::velocity) ? read(Channel::velocity)
                                     : difference(read(Channel::displacement), period_s_);
  if (has(Channel::velocity)) offer_slip(velocity_);
  for (const physics::FilterChain& chain : lowpasses()) {
    const auto smooth = [&](Channel channel) { return lowpassed(read(channel), chain); };
    Values base;
    if (has(Channel::base_displacement)) {
      base = difference(difference(smooth(Channel::base_displacement), period_s_), period_s_);
    }
    const Values x_rate = difference(smooth(Channel::displacement), period_s_);
    if (!has(Channel::velocity)) offer_slip(x_rate);
    if (has(Channel::friction_force)) {
      Values force = inertial_base(base, model_.load_cell ? c_.cell_mass : 0.0);
      add(force, 1.0, read(Channel::friction_force));
      offer_force(force, loads);
      continue;
    }
    Motion mass{read(Channel::displacement), x_rate, difference(x_rate, period_s_)};
    offer_force(balance(mass, base), loads);
    if (!has(Channel::velocity)) continue;
    mass.rate = read(Channel::velocity);
    mass.acceleration = difference(smooth(Channel::velocity), period_s_);
    offer_force(balance(mass, base), loads);
  }
  return found_;
}

constexpr std::array noise_shares = {1.0, 0.0};

// The mass's motion, from the displacement and from the velocity.
std::vector<Motion> Laboratory::mass_candidates() const {
  std::vector<Motion> out;
  for (const double share : noise_shares) {
    const Motion x = inverted(Channel::displacement, share);
    out.push_back(x);
    if (!has(Channel::velocity)) continue;
    Motion v = inverted(Channel::velocity, share);
    out.push_back({x.value, std::move(v.value), std::move(v.rate)});
  }
  return out;
}

std::vector<Values> Laboratory::force_candidates(const Values& base_acceleration) const {
  std::vector<Values> out;
  if (!has(Channel::friction_force)) {
    for (const Motion& mass : mass_candidates()) out.push_back(balance(mass, base_acceleration));
    return out;
  }
  for (const double share : noise_shares) {
    const Motion reading = inverted(Channel::friction_force, share);
    Values force = inertial_base(base_acceleration, model_.load_cell ? c_.cell_mass : 0.0);
    add(force, 1.0, reading.value);
    out.push_back(force);
    if (!model_.load_cell || model_.load_cell->dynamics != physics::LoadCellDynamics::resonant) {
      continue;
    }
    // The channel reads k_l y.
    add(force, c_.cell_damping / c_.cell_stiffness, reading.rate);
    add(force, c_.cell_mass / c_.cell_stiffness, reading.acceleration);
    out.push_back(std::move(force));
  }
  return out;
}

HandErrors Laboratory::best() {
  const std::vector<Values> loads = this->loads(true);
  Values base;
  if (has(Channel::base_displacement)) {
    base = inverted(Channel::base_displacement, 1.0).acceleration;
  }
  const std::vector<Values> forces = force_candidates(base);
  std::vector<Values> slips;
  for (Motion& mass : mass_candidates()) slips.push_back(std::move(mass.rate));
  velocity_ = slips.front();
  if (model_.load_cell && has(Channel::friction_force) &&
      model_.load_cell->dynamics == physics::LoadCellDynamics::resonant) {
    const Values cell_rate = inverted(Channel::friction_force, 1.0).rate;
    for (std::size_t i = 0, count = slips.size(); i < count; ++i) {
      slips.push_back(slips[i]);
      add(slips.back(), -1.0 / c_.cell_stiffness, cell_rate);
    }
  }
  for (const physics::FilterChain& chain : lowpasses()) {
    for (const Values& force : forces) offer_force(lowpassed_without_phase(force, chain), loads);
    for (const Values& slip : slips) offer_slip(lowpassed_without_phase(slip, chain));
  }
  return found_;
}

}  // namespace

HandEstimates estimates_by_hand(const protocol::Recording& recording, const physics::Model& model,
                                std::span<const RigTruth> truth, double sticking_below_m_s) {
  Laboratory laboratory(recording, model, truth, sticking_below_m_s);
  const HandErrors causal = laboratory.causal();
  return {causal, laboratory.best()};
}

}  // namespace stickslip::quality
