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

// p''' = -lambda p' over h. The series of cosine and sine need no root of lambda, which may be 0.
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

// Only the derivatives: its value is already in the Input.
Dual doubt(const Dual& x) { return {0.0, x.d}; }

}  // namespace

DualPrediction::DualPrediction(const physics::Rig& rig, const physics::Model& model,
                               const Layout& layout, double period_s, int steps)
    : Prediction(rig, layout, period_s),
      steps_(steps),
      quasi_static_(rig.structure().load_cell && !rig.structure().resonant) {
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

// The chains are linear, so their own memory moves on in the same way for ever.
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
      recall(memory, chain, unit, 0.0, 0.0);
      const bool differentiated = channel == Channel::displacement;
      const auto& differentiator = chains_[index_of(Channel::velocity)];
      if (differentiated) {
        recall(velocity, layout_->of(Channel::velocity), unit, filters.output_rate(memory), 0.0);
      }
      for (int k = 0; k < steps_; ++k) {
        filters.advance(memory, 0.0, 0.0);
        if (differentiated) differentiator.advance(velocity, filters.output_rate(memory), 0.0);
      }
      const auto put = [&](int row, double value) { memory_(row - core, column - core) = value; };
      each_state(chain, filters, memory, put);
      if (differentiated) {
        each_state(layout_->of(Channel::velocity), differentiator, velocity, put);
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
    pass(mean, time_s, offset);
  }
  fill_transition();
  reading_states_.advance(mean, next_, transition_);
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

void DualPrediction::pass(const Vector& mean, double time_s, int offset) {
  const Layout& layout = *layout_;
  const physics::Structure& structure = rig_->structure();
  const bool base = structure.excitation == Excitation::base;
  const double h = period_s_ / steps_;
  physics::RigNumbers<Dual>& n = dual_numbers_;

  RigState<Dual> rig;
  for (std::size_t i = 0; i < layout.rig.size(); ++i) {
    if (layout.rig[i] >= 0) rig.s[i] = seed(mean, layout.rig[i], offset);
  }
  rig.slip = rig.s[state::v] - rig.s[state::u];
  Dual mu(numbers_.c.mu);
  if (layout.mu >= 0) mu = seed(mean, layout.mu, offset);
  n.c.mu = mu;
  if (layout.log_rate >= 0) n.c.rate = exp(seed(mean, layout.log_rate, offset));
  Dual load(1.0);
  Dual load_rate(0.0);
  if (layout.load >= 0) load = seed(mean, layout.load, offset);
  if (layout.load_rate >= 0) load_rate = seed(mean, layout.load_rate, offset);
  if (layout.load >= 0 && !loaded_by_measurement_) n.c.load = load;
  std::array<Dual, 4> drive;
  for (int i = 0; i < 4; ++i) drive[at(i)] = seed(mean, layout.drive + i, offset);

  const auto input_now = [&] {
    Input now;
    if (base) {
      now.base_displacement_m = drive[0].a;
      now.base_acceleration_m_s2 = drive[2].a;
    } else {
      now.drive_force_n = drive[0].a;
    }
    now.normal_load_n = load.a;
    return now;
  };
  // The measured load enters the equations as a plain number; its doubt goes in with mu.
  const auto weigh = [&](const Dual& n_load) {
    if (loaded_by_measurement_ && n_load.a > 0.0) n.c.mu = mu * (n_load / n_load.a);
  };
  const auto friction_reading = [&](const physics::Quantities<Dual>& q) {
    if (!quasi_static_ || !base) return q.friction_reading;
    return q.friction_reading - n.c.cell_mass * doubt(drive[2]);
  };

  Input now = input_now();
  weigh(load);
  rig_->complete(rig, now, time_s, n);
  physics::Quantities<Dual> q = rig_->quantities(rig, now, n);

  std::array<FilterMemory<Dual>, channel_count> memory;
  const auto chain = [&](Channel c) -> const physics::FilterChain& { return chains_[index_of(c)]; };
  const auto of = [&](Channel c) -> FilterMemory<Dual>& { return memory[index_of(c)]; };
  const Channel driven = drive_channel(structure);
  const bool reads_friction = layout.of(Channel::friction_force).used;
  const bool reads_load = layout.of(Channel::normal_load).used;
  recall(of(Channel::displacement), layout.of(Channel::displacement), mean, q.displacement,
         q.velocity);
  recall(of(Channel::velocity), layout.of(Channel::velocity), mean,
         chain(Channel::displacement).output_rate(of(Channel::displacement)), Dual(0.0));
  if (reads_friction) {
    recall(of(Channel::friction_force), layout.of(Channel::friction_force), mean,
           friction_reading(q), Dual(0.0));
  }
  if (reads_load) {
    recall(of(Channel::normal_load), layout.of(Channel::normal_load), mean,
           loaded_by_measurement_ ? load : q.normal_load, Dual(0.0));
  }
  recall(of(driven), layout.of(driven), mean, drive[0], Dual(0.0));

  for (int k = 0; k < steps_; ++k) {
    const Input begin = now;
    const std::array<Dual, 4> drive_before = drive;
    const Dual load_before = load;
    advance_drive(drive, h);
    load += load_rate * h;
    load_rate *= 1.0 - h / load_rate_memory_s;
    now = input_now();
    weigh(0.5 * (load_before + load));

    // The input's doubt acts as a kick before the step; the deflection that a kick at the start
    // makes too much of is taken back.
    if (base) {
      const Dual kick = (-0.5 * h) * doubt(drive_before[2] + drive[2]);
      const Dual back = (-0.5 * h) * kick;
      rig.s[state::v] += kick;
      rig.s[state::x] += back;
      if (structure.resonant) {
        rig.s[state::u] += kick;
        rig.s[state::y] += back;
      }
    } else {
      const Dual kick = (0.5 * h * numbers_.inverse_mass) * doubt(drive_before[0] + drive[0]);
      rig.s[state::v] += kick;
      rig.s[state::x] += (-0.5 * h) * kick;
    }
    rig_->step(rig, begin, now, time_s + k * h, h, n);

    q = rig_->quantities(rig, now, n);
    chain(Channel::displacement).advance(of(Channel::displacement), q.displacement, q.velocity);
    chain(Channel::velocity)
        .advance(of(Channel::velocity),
                 chain(Channel::displacement).output_rate(of(Channel::displacement)), Dual(0.0));
    if (reads_friction) {
      chain(Channel::friction_force)
          .advance(of(Channel::friction_force), friction_reading(q), Dual(0.0));
    }
    if (reads_load) {
      chain(Channel::normal_load)
          .advance(of(Channel::normal_load), loaded_by_measurement_ ? load : q.normal_load,
                   Dual(0.0));
    }
    chain(driven).advance(of(driven), drive[0], Dual(0.0));
  }

  const int directions = std::min(Dual::directions, layout.core - offset);
  const auto put = [&](int row, const Dual& value) {
    next_[row] = value.a;
    for (int i = 0; i < directions; ++i) by_core_(row, offset + i) = value.d[i];
  };
  const auto put_same = [&](int row) {
    if (row >= 0) put(row, seed(mean, row, offset));
  };
  if (layout.friction >= 0) put(layout.friction, rig.friction);
  if (layout.theta >= 0) put(layout.theta, rig.theta);
  for (std::size_t i = 0; i < layout.rig.size(); ++i) {
    if (layout.rig[i] >= 0) put(layout.rig[i], rig.s[i]);
  }
  put_same(layout.mu);
  put_same(layout.log_rate);
  if (layout.load >= 0) put(layout.load, load);
  if (layout.load_rate >= 0) put(layout.load_rate, load_rate);
  for (int i = 0; i < 4; ++i) put(layout.drive + i, drive[at(i)]);
  for (Channel channel : all_channels) {
    const Chain& each = layout.of(channel);
    if (each.used) each_state(each, chain(channel), of(channel), put);
  }
}

}  // namespace stickslip::observer
