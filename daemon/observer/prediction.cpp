#include "daemon/observer/prediction.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

namespace stickslip::observer {

namespace {

using physics::Dual;
using physics::Excitation;
using physics::FilterMemory;
using physics::Input;
using physics::NormalLoadLaw;
using physics::RigState;
namespace state = physics::state;

// p' and p'' are forgotten over this time, so that a drive that nobody measures cannot run away.
constexpr double drive_memory_s = 20.0;
constexpr double load_rate_memory_s = 1.0;

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

Prediction::Prediction(const physics::Rig& rig, const physics::Model& model, const Layout& layout,
                       double period_s, int steps)
    : rig_(&rig),
      layout_(&layout),
      period_s_(period_s),
      steps_(steps),
      loaded_by_measurement_(rig.structure().loaded &&
                             rig.structure().load_law == NormalLoadLaw::measured),
      quasi_static_(rig.structure().load_cell && !rig.structure().resonant) {
  for (Channel channel : all_channels) {
    if (!layout.of(channel).used) continue;
    chains_[index_of(channel)] =
        physics::FilterChain(model.sensors[index_of(channel)].filters, period_s / steps);
  }
  const std::vector<double>& values = rig.parameter_values();
  numbers_ = rig.numbers<double>(values);
  const std::vector<Dual> dual_values(values.begin(), values.end());
  dual_numbers_ = rig.numbers<Dual>(std::span<const Dual>(dual_values));
  const int tail = layout.count - layout.core;
  transition_.core = Matrix::Zero(layout.core, layout.core);
  transition_.tail = Matrix::Zero(tail, layout.core);
  transition_.memory = Matrix::Zero(tail, tail);
  next_ = Vector::Zero(layout.count);
  fill_memory_transition();
}

// A chain's memory from the filter's states; what an input just was is not a state of its own.
template <class T>
void Prediction::recall(FilterMemory<T>& memory, Channel channel, const Vector& states,
                        const T& input, const T& input_rate) const {
  const Chain& chain = layout_->of(channel);
  memory.input = input;
  memory.input_rate = input_rate;
  T before = input;
  int next = chain.first;
  for (std::size_t i = 0; i < chain.sections.size(); ++i) {
    const Section& section = chain.sections[i];
    const T output(states[next++]);
    memory.section[i][0] = output;
    memory.section[i][1] =
        section.second_order ? T(states[next++]) : T((before - output) * section.omega);
    before = output;
  }
}

namespace {

// Calls visit(state index, value) for every state of a chain.
template <class T, class Visit>
void each_state(const Chain& chain, const physics::FilterChain& filters,
                const FilterMemory<T>& memory, Visit visit) {
  if (chain.sections.empty()) {
    visit(chain.reading, filters.output(memory));
    return;
  }
  int next = chain.first;
  for (std::size_t i = 0; i < chain.sections.size(); ++i) {
    visit(next++, memory.section[i][0]);
    if (chain.sections[i].second_order) visit(next++, memory.section[i][1]);
  }
}

}  // namespace

// The chains are linear, so their own memory moves on in the same way for ever.
void Prediction::fill_memory_transition() {
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
      recall(memory, channel, unit, 0.0, 0.0);
      const bool differentiated = channel == Channel::displacement;
      const auto& differentiator = chains_[index_of(Channel::velocity)];
      if (differentiated) {
        recall(velocity, Channel::velocity, unit, filters.output_rate(memory), 0.0);
      }
      for (int k = 0; k < steps_; ++k) {
        filters.advance(memory, 0.0, 0.0);
        if (differentiated) differentiator.advance(velocity, filters.output_rate(memory), 0.0);
      }
      const auto put = [&](int row, double value) {
        transition_.memory(row - core, column - core) = value;
      };
      each_state(chain, filters, memory, put);
      if (differentiated) {
        each_state(layout_->of(Channel::velocity), differentiator, velocity, put);
      }
    }
  }
}

Dual Prediction::seed(const Vector& mean, int index, int offset) const {
  Dual value(mean[index]);
  const int direction = index - offset;
  if (direction >= 0 && direction < Dual::directions) value.d[direction] = 1.0;
  return value;
}

void Prediction::advance(Vector& mean, double time_s, double slip_variance) {
  // The mean of tanh(v / v0) over a Gaussian doubt of v is about a wider tanh; exact in slope for
  // v0 = 0, where it is erf. It also keeps the set-valued law differentiable.
  const double own = numbers_.c.transition_speed;
  const double doubtful = 0.5 * std::numbers::pi * std::max(slip_variance, 0.0);
  dual_numbers_.c.transition_speed = Dual(std::sqrt(own * own + doubtful + 1.0e-14));
  for (int offset = 0; offset < layout_->core; offset += Dual::directions) {
    pass(mean, time_s, offset);
  }
  mean = next_;
}

void Prediction::pass(const Vector& mean, double time_s, int offset) {
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
  recall(of(Channel::displacement), Channel::displacement, mean, q.displacement, q.velocity);
  recall(of(Channel::velocity), Channel::velocity, mean,
         chain(Channel::displacement).output_rate(of(Channel::displacement)), Dual(0.0));
  if (reads_friction) {
    recall(of(Channel::friction_force), Channel::friction_force, mean, friction_reading(q),
           Dual(0.0));
  }
  if (reads_load) {
    recall(of(Channel::normal_load), Channel::normal_load, mean,
           loaded_by_measurement_ ? load : q.normal_load, Dual(0.0));
  }
  recall(of(driven), driven, mean, drive[0], Dual(0.0));

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
    auto& matrix = row < layout.core ? transition_.core : transition_.tail;
    const int r = row < layout.core ? row : row - layout.core;
    for (int i = 0; i < directions; ++i) matrix(r, offset + i) = value.d[i];
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
