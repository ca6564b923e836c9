// SPDX-License-Identifier: Apache-2.0
#include "physics/sensor_chain.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace stickslip::physics {

namespace {

using std::numbers::pi;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// exp(m) by scaling and squaring of the Taylor series, for small and well scaled m.
Matrix6 exponential(Matrix6 m) {
  int squarings = 0;
  while (m.cwiseAbs().maxCoeff() > 0.25 && squarings < 40) {
    m *= 0.5;
    ++squarings;
  }
  Matrix6 sum = Matrix6::Identity();
  Matrix6 term = Matrix6::Identity();
  for (int k = 1; k <= 14; ++k) {
    term = term * m / static_cast<double>(k);
    sum += term;
  }
  for (int k = 0; k < squarings; ++k) sum = sum * sum;
  return sum;
}

}  // namespace

FilterChain::FilterChain(std::span<const Filter> filters, double step_s, InputCourse course,
                         double scale)
    : step_s_(step_s), course_(course) {
  const auto add = [this](bool second_order, double omega, double damping) {
    if (count_ == max_filter_sections) {
      throw std::invalid_argument("a sensor chain may have at most " +
                                  std::to_string(max_filter_sections) +
                                  " second-order filter sections");
    }
    sections_[count_++] = section_of(second_order, omega, damping);
  };
  for (const Filter& filter : filters) {
    const int order = filter.kind == FilterKind::first_order_lowpass ? 1 : filter.order;
    const double omega = 2.0 * pi * filter.cutoff_hz.value * scale;
    if (order % 2 == 1) add(false, omega, 0.0);
    for (int k = 0; k < order / 2; ++k) {
      add(true, omega, 2.0 * std::sin(pi * (2 * k + 1) / (2.0 * order)) * omega);
    }
  }
}

FilterChain::Section FilterChain::section_of(bool second_order, double omega,
                                             double damping) const {
  Section section;
  section.second_order = second_order;
  section.cubic = course_ == InputCourse::cubic;
  section.omega = omega;
  section.damping = damping;
  section.lag_s = second_order ? damping / (omega * omega) : 1.0 / omega;
  // The section augmented by its input u and three derivatives of it as states; time in steps.
  Matrix6 m = Matrix6::Zero();
  const double w = omega * step_s_;
  if (second_order) {
    m(0, 1) = step_s_;
    m(1, 0) = -w * omega;
    m(1, 1) = -damping * step_s_;
    m(1, 2) = w * omega;
  } else {
    m(0, 0) = -w;
    m(0, 2) = w;
  }
  for (int i = 2; i < 5; ++i) m(i, i + 1) = 1.0;
  // The rate is scaled by omega to balance the entries of m.
  Eigen::Vector<double, 6> scale = Eigen::Vector<double, 6>::Ones();
  scale[1] = omega;
  const Matrix6 scaled = scale.cwiseInverse().asDiagonal() * m * scale.asDiagonal();
  const Matrix6 e = scale.asDiagonal() * exponential(scaled) * scale.cwiseInverse().asDiagonal();
  section.phi = {e(0, 0), e(0, 1), e(1, 0), e(1, 1)};
  for (int i = 0; i < 2; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!section.cubic) {
      section.start[k] = e(i, 2) - e(i, 3);
      section.end[k] = e(i, 3);
    } else {  // second and third derivative of the cubic from its values and slopes
      section.start[k] = e(i, 2) - 6.0 * e(i, 4) + 12.0 * e(i, 5);
      section.end[k] = 6.0 * e(i, 4) - 12.0 * e(i, 5);
      section.start_rate[k] = step_s_ * (e(i, 3) - 4.0 * e(i, 4) + 6.0 * e(i, 5));
      section.end_rate[k] = step_s_ * (-2.0 * e(i, 4) + 6.0 * e(i, 5));
    }
  }
  return section;
}

void FilterChain::allow_changes() {
  constexpr double some = 1.0e-4;
  const auto slope = [](double below, double above) { return (above - below) / (2.0 * some); };
  for (std::size_t i = 0; i < count_; ++i) {
    const Section& section = sections_[i];
    const auto at = [&](double factor) {
      return section_of(section.second_order, section.omega * factor, section.damping * factor);
    };
    const Section below = at(1.0 - some);
    const Section above = at(1.0 + some);
    Section& slopes = slopes_[i];
    slopes = section;
    for (std::size_t k = 0; k < 4; ++k) slopes.phi[k] = slope(below.phi[k], above.phi[k]);
    for (std::size_t k = 0; k < 2; ++k) {
      slopes.start[k] = slope(below.start[k], above.start[k]);
      slopes.end[k] = slope(below.end[k], above.end[k]);
      slopes.start_rate[k] = slope(below.start_rate[k], above.start_rate[k]);
      slopes.end_rate[k] = slope(below.end_rate[k], above.end_rate[k]);
    }
  }
}

template <class T>
void FilterChain::settle(FilterMemory<T>& memory, const T& value, const T& rate,
                         const T* change) const {
  memory.input = value;
  memory.input_rate = rate;
  T level = value;
  for (std::size_t i = 0; i < count_; ++i) {
    level = level - rate * sections_[i].lag_s;
    if (change) level += *change * (value_of(rate) * sections_[i].lag_s);
    memory.section[i] = {level, rate};
  }
}

template <class T>
T FilterChain::Section::next(std::size_t row, const Value<T>& state, const Value<T>& before,
                             const Value<T>& after) const {
  T sum = phi[2 * row] * state[0] + start[row] * before[0] + end[row] * after[0];
  if (second_order) sum += phi[2 * row + 1] * state[1];
  if (cubic) sum += start_rate[row] * before[1] + end_rate[row] * after[1];
  return sum;
}

template <class T>
void FilterChain::advance(FilterMemory<T>& memory, const T& input, const T& input_rate,
                          const T* change) const {
  Value<T> before = {memory.input, memory.input_rate};
  Value<T> after = {input, input_rate};
  memory.input = input;
  memory.input_rate = input_rate;
  for (std::size_t i = 0; i < count_; ++i) {
    const Section& section = sections_[i];
    Value<T>& state = memory.section[i];
    const Value<T> was = state;
    state[0] = section.next(0, was, before, after);
    state[1] = section.second_order ? section.next(1, was, before, after)
                                    : (after[0] - state[0]) * section.omega;
    if (change) add_change(i, *change, was, before, after, state);
    before = was;
    after = state;
  }
}

// The derivatives of a section's state after a step by the change of the cut-offs.
template <class T>
void FilterChain::add_change(std::size_t i, const T& change, const Value<T>& was,
                             const Value<T>& before, const Value<T>& after, Value<T>& state) const {
  const auto values = [](const Value<T>& x) {
    return Value<double>{value_of(x[0]), value_of(x[1])};
  };
  const auto slope = [&](std::size_t row) {
    return slopes_[i].next(row, values(was), values(before), values(after));
  };
  const Section& section = sections_[i];
  const double of_output = slope(0);
  state[0] += change * of_output;
  state[1] +=
      change * (section.second_order ? slope(1) : value_of(state[1]) - section.omega * of_output);
}

template <class T>
T FilterChain::output_rate(const FilterMemory<T>& memory) const {
  return count_ == 0 ? memory.input_rate : memory.section[count_ - 1][1];
}

template <class T>
T FilterChain::output_acceleration(const FilterMemory<T>& memory, const T* change) const {
  if (count_ == 0) return T(0.0);
  const Section& last = sections_[count_ - 1];
  const Value<T> input =
      count_ > 1 ? memory.section[count_ - 2] : Value<T>{memory.input, memory.input_rate};
  const auto& [y, rate] = memory.section[count_ - 1];
  if (!last.second_order) {
    T acceleration = (input[1] - rate) * last.omega;
    if (change) acceleration += *change * value_of(acceleration);
    return acceleration;
  }
  const T restoring = (input[0] - y) * (last.omega * last.omega);
  const T damping = rate * last.damping;
  T acceleration = restoring - damping;
  if (change) acceleration += *change * (2.0 * value_of(restoring) - value_of(damping));
  return acceleration;
}

std::complex<double> FilterChain::response(double frequency_hz) const {
  return transfer({0.0, 2.0 * pi * frequency_hz});
}

std::complex<double> FilterChain::transfer(std::complex<double> s) const {
  std::complex<double> product(1.0, 0.0);
  for (std::size_t i = 0; i < count_; ++i) {
    const Section& section = sections_[i];
    const double w2 = section.omega * section.omega;
    product *= section.second_order ? w2 / (s * s + section.damping * s + w2)
                                    : section.omega / (s + section.omega);
  }
  return product;
}

double FilterChain::lag_s() const {
  double lag = 0.0;
  for (std::size_t i = 0; i < count_; ++i) lag += sections_[i].lag_s;
  return lag;
}

double FilterChain::settling_time_s() const {
  double time = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    const Section& section = sections_[i];
    time = std::max(time, 6.2 / (section.second_order ? 0.5 * section.damping : section.omega));
  }
  return time;
}

SensorBank::SensorBank(const Model& model, double step_s)
    : SensorBank(model, step_s, {1.0, 1.0, 1.0, 1.0}) {}

SensorBank::SensorBank(const Model& model, double step_s, const CutoffChanges<double>& scales) {
  const auto chain = [&](Channel channel, InputCourse course) {
    const auto& filters = model.sensors[index_of(channel)].filters;
    return FilterChain(filters, step_s, course, scales[index_of(channel)]);
  };
  using enum InputCourse;
  displacement_ = chain(Channel::displacement, cubic);
  // Unfiltered, the velocity's slope jumps with friction.
  velocity_ = chain(Channel::velocity, displacement_.empty() ? linear : cubic);
  friction_force_ = chain(Channel::friction_force, linear);
  normal_load_ = chain(Channel::normal_load, linear);
}

void SensorBank::allow_changes() {
  for (FilterChain* each : {&displacement_, &velocity_, &friction_force_, &normal_load_}) {
    each->allow_changes();
  }
}

namespace {

template <class T>
const T* of_channel(const CutoffChanges<T>* changes, Channel channel) {
  return changes ? &(*changes)[index_of(channel)] : nullptr;
}

}  // namespace

template <class T>
void SensorBank::settle(SensorMemory<T>& memory, const Quantities<T>& q,
                        const CutoffChanges<T>* changes) const {
  displacement_.settle(memory.displacement, q.displacement, q.velocity,
                       of_channel(changes, Channel::displacement));
  velocity_.settle(memory.velocity, q.velocity, T(0.0), of_channel(changes, Channel::velocity));
  friction_force_.settle(memory.friction_force, q.friction_reading, T(0.0),
                         of_channel(changes, Channel::friction_force));
  normal_load_.settle(memory.normal_load, q.normal_load, T(0.0),
                      of_channel(changes, Channel::normal_load));
}

template <class T>
void SensorBank::advance(SensorMemory<T>& memory, const Quantities<T>& q,
                         const CutoffChanges<T>* changes) const {
  displacement_.advance(memory.displacement, q.displacement, q.velocity,
                        of_channel(changes, Channel::displacement));
  velocity_.advance(memory.velocity, displacement_.output_rate(memory.displacement),
                    displacement_.output_acceleration(memory.displacement,
                                                      of_channel(changes, Channel::displacement)),
                    of_channel(changes, Channel::velocity));
  friction_force_.advance(memory.friction_force, q.friction_reading, T(0.0),
                          of_channel(changes, Channel::friction_force));
  normal_load_.advance(memory.normal_load, q.normal_load, T(0.0),
                       of_channel(changes, Channel::normal_load));
}

template <class T>
Readings<T> SensorBank::readings(const SensorMemory<T>& memory) const {
  return {displacement_.output(memory.displacement), velocity_.output(memory.velocity),
          friction_force_.output(memory.friction_force), normal_load_.output(memory.normal_load)};
}

const FilterChain& SensorBank::chain(Channel channel) const {
  switch (channel) {
    case Channel::displacement:
      return displacement_;
    case Channel::velocity:
      return velocity_;
    case Channel::friction_force:
      return friction_force_;
    case Channel::normal_load:
      return normal_load_;
    default:
      throw std::invalid_argument("the sensor bank has no chain for this channel");
  }
}

double SensorBank::settling_time_s() const {
  return std::max({displacement_.settling_time_s() + velocity_.settling_time_s(),
                   friction_force_.settling_time_s(), normal_load_.settling_time_s()});
}

template void FilterChain::settle(FilterMemory<double>&, const double&, const double&,
                                  const double*) const;
template void FilterChain::settle(FilterMemory<Dual>&, const Dual&, const Dual&, const Dual*) const;
template void FilterChain::advance(FilterMemory<double>&, const double&, const double&,
                                   const double*) const;
template void FilterChain::advance(FilterMemory<Dual>&, const Dual&, const Dual&,
                                   const Dual*) const;
template double FilterChain::output_rate(const FilterMemory<double>&) const;
template Dual FilterChain::output_rate(const FilterMemory<Dual>&) const;
template double FilterChain::output_acceleration(const FilterMemory<double>&, const double*) const;
template Dual FilterChain::output_acceleration(const FilterMemory<Dual>&, const Dual*) const;
template void SensorBank::settle(SensorMemory<double>&, const Quantities<double>&,
                                 const CutoffChanges<double>*) const;
template void SensorBank::settle(SensorMemory<Dual>&, const Quantities<Dual>&,
                                 const CutoffChanges<Dual>*) const;
template void SensorBank::advance(SensorMemory<double>&, const Quantities<double>&,
                                  const CutoffChanges<double>*) const;
template void SensorBank::advance(SensorMemory<Dual>&, const Quantities<Dual>&,
                                  const CutoffChanges<Dual>*) const;
template Readings<double> SensorBank::readings(const SensorMemory<double>&) const;
template Readings<Dual> SensorBank::readings(const SensorMemory<Dual>&) const;

}  // namespace stickslip::physics
