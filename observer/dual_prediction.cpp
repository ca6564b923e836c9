// SPDX-License-Identifier: Apache-2.0
#include "observer/dual_prediction.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stickslip::observer {

namespace {

using physics::Dual;
using physics::Excitation;
using physics::FilterMemory;
using physics::Input;
using physics::RigState;
namespace state = physics::state;

std::size_t at(int index) { return static_cast<std::size_t>(index); }

// p''' = -lambda p' over h. Series of cosine and sine, because lambda may be 0.
void advance_drive(std::array<Dual, 4>& drive, double h) {
  auto& [p, rate, acceleration, lambda] = drive;
  const Dual z = lambda * (h * h);
  const Dual cosine = 1.0 - z * (0.5 - z * (1.0 / 24.0));
  const Dual sine = h * (1.0 - z * (1.0 / 6.0 - z * (1.0 / 120.0)));
  const Dual rise = (h * h) * (0.5 - z * (1.0 / 24.0 - z * (1.0 / 720.0)));
  const double kept = 1.0 - h / drive_memory_s;
  p += rate * sine + acceleration * rise;
  const Dual old_rate = rate;
  rate = kept * (old_rate * cosine + acceleration * sine);
  acceleration = kept * (acceleration * cosine - lambda * sine * old_rate);
}

// Derivatives only: the value is already in the Input.
Dual derivatives_of(const Dual& x) { return {0.0, x.d}; }

}  // namespace

DualPrediction::DualPrediction(const physics::Rig& rig, const physics::Model& model,
                               const Layout& layout, double period_s, int steps)
    : Prediction(rig, layout, period_s),
      steps_(steps),
      quasi_static_(rig.structure().load_cell && !rig.structure().resonant),
      excitation_(rig.structure().excitation) {
  for (Channel channel : all_channels) {
    if (!layout.of(channel).used) continue;
    chains_[index_of(channel)] =
        physics::FilterChain(model.sensors[index_of(channel)].filters, period_s / steps);
  }
  const int tail = layout.count - layout.core;
  by_core_ = Matrix::Zero(layout.count, layout.core);
  memory_ = Matrix::Zero(tail, tail);
  fill_memory_transition();
}

// The chains are linear and time-invariant, so their transition is found once.
void DualPrediction::fill_memory_transition() {
  const int core = layout_->core;
  Vector unit = Vector::Zero(layout_->count);
  for (int column = core; column < layout_->count; ++column) {
    unit.setZero();
    unit[column] = 1.0;
    FilterMemory<double> velocity;
    for (Channel channel : all_channels) {
      const Chain& chain = layout_->of(channel);
      if (!chain.used || channel == Channel::velocity) continue;
      const auto& filters = chains_[index_of(channel)];
      FilterMemory<double> memory;
      load_memory(memory, chain, unit, 0.0, 0.0);
      const bool differentiated = channel == Channel::displacement;
      const auto& differentiator = chains_[index_of(Channel::velocity)];
      if (differentiated) {
        load_memory(velocity, layout_->of(Channel::velocity), unit, filters.output_rate(memory),
                    0.0);
      }
      for (int k = 0; k < steps_; ++k) {
        filters.advance(memory, 0.0, 0.0);
        if (differentiated) differentiator.advance(velocity, filters.output_rate(memory), 0.0);
      }
      const auto put = [&](int row, double value) { memory_(row - core, column - core) = value; };
      for_each_state(chain, filters, memory, put);
      if (differentiated) {
        for_each_state(layout_->of(Channel::velocity), differentiator, velocity, put);
      }
    }
  }
}

Dual DualPrediction::seed(const Vector& mean, int index, int offset) const {
  Dual value(mean[index]);
  const int direction = index - offset;
  if (direction >= 0 && direction < Dual::directions) value.d[direction] = 1.0;
  return value;
}

void DualPrediction::advance(Vector& mean, double time_s, double slip_variance) {
  dual_numbers_.c.transition_speed = Dual(widened_transition_speed(slip_variance));
  for (int offset = 0; offset < layout_->core; offset += Dual::directions) {
    propagate(mean, time_s, offset);
  }
  fill_transition();
  sensor_error_states_.advance(mean, next_, transition_);
  mean = next_;
}

void DualPrediction::fill_transition() {
  const int core = layout_->core;
  transition_.clear();
  for (int row = 0; row < layout_->count; ++row) {
    transition_.begin_row();
    for (int from = 0; from < core; ++from) {
      const double weight = by_core_(row, from);
      if (weight != 0.0) transition_.add(from, weight);
    }
    for (int from = core; row >= core && from < layout_->count; ++from) {
      const double weight = memory_(row - core, from - core);
      if (weight != 0.0) transition_.add(from, weight);
    }
  }
}

// The measured load enters the equations as a plain number; its derivatives are carried by mu.
void DualPrediction::set_measured_load(const Dual& mu, const Dual& load) {
  if (loaded_by_measurement_ && load.a > 0.0) dual_numbers_.c.mu = mu * (load / load.a);
}

Input DualPrediction::input_of(const DualStates& s) const {
  return observer::input_of(excitation_, s.drive[0].a, s.drive[1].a, s.drive[2].a, s.load.a);
}

Dual DualPrediction::friction_reading(const DualStates& s) const {
  if (!quasi_static_ || !is_base_excited()) return s.quantities.friction_reading;
  return s.quantities.friction_reading - dual_numbers_.c.cell_mass * derivatives_of(s.drive[2]);
}

Dual DualPrediction::load_reading(const DualStates& s) const {
  return loaded_by_measurement_ ? s.load : s.quantities.normal_load;
}

void DualPrediction::load_states(const Vector& mean, int offset, DualStates& s) {
  const Layout& layout = *layout_;
  physics::RigNumbers<Dual>& n = dual_numbers_;
  for (std::size_t i = 0; i < layout.rig.size(); ++i) {
    if (layout.rig[i] >= 0) s.rig.s[i] = seed(mean, layout.rig[i], offset);
  }
  s.rig.slip = s.rig.s[state::v] - s.rig.s[state::u];
  s.mu = Dual(numbers_.c.mu);
  if (layout.mu >= 0) s.mu = seed(mean, layout.mu, offset);
  n.c.mu = s.mu;
  if (layout.log_rate >= 0) n.c.rate = exp(seed(mean, layout.log_rate, offset));
  if (layout.load >= 0) s.load = seed(mean, layout.load, offset);
  if (layout.load_rate >= 0) s.load_rate = seed(mean, layout.load_rate, offset);
  if (layout.load >= 0 && !loaded_by_measurement_) n.c.load = s.load;
  for (int i = 0; i < 4; ++i) s.drive[at(i)] = seed(mean, layout.drive + i, offset);
}

void DualPrediction::load_chains(const Vector& mean, DualStates& s) const {
  const Layout& layout = *layout_;
  const auto load = [&](Channel c, const Dual& input, const Dual& input_rate) {
    load_memory(s.memory[index_of(c)], layout.of(c), mean, input, input_rate);
  };
  constexpr std::size_t x = index_of(Channel::displacement);
  load(Channel::displacement, s.quantities.displacement, s.quantities.velocity);
  load(Channel::velocity, chains_[x].output_rate(s.memory[x]), Dual(0.0));
  if (layout.of(Channel::friction_force).used) {
    load(Channel::friction_force, friction_reading(s), Dual(0.0));
  }
  if (layout.of(Channel::normal_load).used) {
    load(Channel::normal_load, load_reading(s), Dual(0.0));
  }
  if (excitation_ == Excitation::imposed) return;  // its motion is that of the mass
  load(drive_channel(rig_->structure()), s.drive[0], Dual(0.0));
}

// The derivatives by the input act as an impulse before the step; the displacement that an impulse
// at the start overestimates is subtracted.
void DualPrediction::apply_input_derivatives(DualStates& s, const std::array<Dual, 4>& drive_before,
                                             double h) const {
  RigState<Dual>& rig = s.rig;
  if (excitation_ == Excitation::imposed) {
    rig.s[state::x] = s.drive[0];
    rig.s[state::v] = s.drive[1];
  } else if (is_base_excited()) {
    const Dual kick = (-0.5 * h) * derivatives_of(drive_before[2] + s.drive[2]);
    const Dual back = (-0.5 * h) * kick;
    rig.s[state::v] += kick;
    rig.s[state::x] += back;
    if (rig_->structure().resonant) {
      rig.s[state::u] += kick;
      rig.s[state::y] += back;
    }
  } else {
    const Dual kick =
        (0.5 * h * numbers_.inverse_mass) * derivatives_of(drive_before[0] + s.drive[0]);
    rig.s[state::v] += kick;
    rig.s[state::x] += (-0.5 * h) * kick;
  }
}

void DualPrediction::advance_chains(DualStates& s) const {
  const auto advance = [&](Channel c, const Dual& input, const Dual& input_rate) {
    chains_[index_of(c)].advance(s.memory[index_of(c)], input, input_rate);
  };
  constexpr std::size_t x = index_of(Channel::displacement);
  advance(Channel::displacement, s.quantities.displacement, s.quantities.velocity);
  advance(Channel::velocity, chains_[x].output_rate(s.memory[x]), Dual(0.0));
  if (layout_->of(Channel::friction_force).used) {
    advance(Channel::friction_force, friction_reading(s), Dual(0.0));
  }
  if (layout_->of(Channel::normal_load).used) {
    advance(Channel::normal_load, load_reading(s), Dual(0.0));
  }
  if (excitation_ == Excitation::imposed) return;
  advance(drive_channel(rig_->structure()), s.drive[0], Dual(0.0));
}

void DualPrediction::step(DualStates& s, double time_s) {
  const double h = period_s_ / steps_;
  const Input begin = input_of(s);
  const std::array<Dual, 4> drive_before = s.drive;
  const Dual load_before = s.load;
  advance_drive(s.drive, h);
  s.load += s.load_rate * h;
  s.load_rate *= 1.0 - h / load_rate_memory_s;
  const Input end = input_of(s);
  set_measured_load(s.mu, 0.5 * (load_before + s.load));
  apply_input_derivatives(s, drive_before, h);
  rig_->step(s.rig, begin, end, time_s, h, dual_numbers_);
  s.quantities = rig_->quantities(s.rig, end, dual_numbers_);
  advance_chains(s);
}

void DualPrediction::store_states(const Vector& mean, int offset, const DualStates& s) {
  const Layout& layout = *layout_;
  const int directions = std::min(Dual::directions, layout.core - offset);
  const auto put = [&](int row, const Dual& value) {
    next_[row] = value.a;
    for (int i = 0; i < directions; ++i) by_core_(row, offset + i) = value.d[i];
  };
  const auto put_same = [&](int row) {
    if (row >= 0) put(row, seed(mean, row, offset));
  };
  if (layout.friction >= 0) put(layout.friction, s.rig.friction);
  if (layout.theta >= 0) put(layout.theta, s.rig.theta);
  for (std::size_t i = 0; i < layout.rig.size(); ++i) {
    if (layout.rig[i] >= 0) put(layout.rig[i], s.rig.s[i]);
  }
  put_same(layout.mu);
  put_same(layout.log_rate);
  if (layout.load >= 0) put(layout.load, s.load);
  if (layout.load_rate >= 0) put(layout.load_rate, s.load_rate);
  for (int i = 0; i < 4; ++i) put(layout.drive + i, s.drive[at(i)]);
  for (Channel channel : all_channels) {
    const Chain& chain = layout.of(channel);
    const std::size_t i = index_of(channel);
    if (chain.used) for_each_state(chain, chains_[i], s.memory[i], put);
  }
}

void DualPrediction::propagate(const Vector& mean, double time_s, int offset) {
  DualStates s;
  load_states(mean, offset, s);
  const Input start = input_of(s);
  set_measured_load(s.mu, s.load);
  rig_->complete(s.rig, start, time_s, dual_numbers_);
  s.quantities = rig_->quantities(s.rig, start, dual_numbers_);
  load_chains(mean, s);
  const double h = period_s_ / steps_;
  for (int k = 0; k < steps_; ++k) step(s, time_s + k * h);
  store_states(mean, offset, s);
}

}  // namespace stickslip::observer
