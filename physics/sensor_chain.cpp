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
using Matrix4 = Eigen::Matrix4d;

// exp(m) by scaling and squaring of the Taylor series, for small and well scaled m.
Matrix4 exponential(Matrix4 m) {
  int squarings = 0;
  while (m.cwiseAbs().maxCoeff() > 0.25 && squarings < 40) {
    m *= 0.5;
    ++squarings;
  }
  Matrix4 sum = Matrix4::Identity();
  Matrix4 term = Matrix4::Identity();
  for (int k = 1; k <= 14; ++k) {
    term = term * m / static_cast<double>(k);
    sum += term;
  }
  for (int k = 0; k < squarings; ++k) sum = sum * sum;
  return sum;
}

}  // namespace

FilterChain::FilterChain(std::span<const Filter> filters, double step_s) {
  const auto add = [this](bool second_order, double omega, double damping) {
    if (count_ == max_filter_sections) {
      throw std::invalid_argument("a sensor chain may have at most " +
                                  std::to_string(max_filter_sections) +
                                  " second-order filter sections");
    }
    Section& section = sections_[count_++];
    section.second_order = second_order;
    section.omega = omega;
    section.damping = damping;
  };
  for (const Filter& filter : filters) {
    const int order = filter.kind == FilterKind::first_order_lowpass ? 1 : filter.order;
    const double omega = 2.0 * pi * filter.cutoff_hz.value;
    if (order % 2 == 1) add(false, omega, 0.0);
    for (int k = 0; k < order / 2; ++k) {
      add(true, omega, 2.0 * std::sin(pi * (2 * k + 1) / (2.0 * order)) * omega);
    }
  }
  for (std::size_t i = 0; i < count_; ++i) {
    Section& section = sections_[i];
    // The section augmented by its input u and the input's slope as states; time in steps.
    Matrix4 m = Matrix4::Zero();
    const double w = section.omega * step_s;
    if (section.second_order) {
      m(0, 1) = step_s;
      m(1, 0) = -w * section.omega;
      m(1, 1) = -section.damping * step_s;
      m(1, 2) = w * section.omega;
    } else {
      m(0, 0) = -w;
      m(0, 2) = w;
    }
    m(2, 3) = 1.0;
    // The rate is scaled by omega to balance the entries of m.
    const Eigen::Vector4d scale(1.0, section.omega, 1.0, 1.0);
    const Matrix4 scaled = scale.cwiseInverse().asDiagonal() * m * scale.asDiagonal();
    const Matrix4 e = scale.asDiagonal() * exponential(scaled) * scale.cwiseInverse().asDiagonal();
    section.phi = {e(0, 0), e(0, 1), e(1, 0), e(1, 1)};
    for (int i = 0; i < 2; ++i) {
      section.end[static_cast<std::size_t>(i)] = e(i, 3);
      section.start[static_cast<std::size_t>(i)] = e(i, 2) - e(i, 3);
    }
  }
}

template <class T>
void FilterChain::settle(FilterMemory<T>& memory, const T& value, const T& rate) const {
  memory.input = value;
  memory.input_rate = rate;
  T level = value;
  for (std::size_t i = 0; i < count_; ++i) {
    const Section& section = sections_[i];
    const double lag = section.second_order ? section.damping / (section.omega * section.omega)
                                            : 1.0 / section.omega;
    level = level - rate * lag;
    memory.section[i] = {level, rate};
  }
}

template <class T>
void FilterChain::advance(FilterMemory<T>& memory, const T& input, const T& input_rate) const {
  T before = memory.input;
  T after = input;
  memory.input = input;
  memory.input_rate = input_rate;
  for (std::size_t i = 0; i < count_; ++i) {
    const Section& section = sections_[i];
    auto& [y, rate] = memory.section[i];
    const T was = y;
    if (section.second_order) {
      const T next = section.phi[0] * y + section.phi[1] * rate + section.start[0] * before +
                     section.end[0] * after;
      rate = section.phi[2] * y + section.phi[3] * rate + section.start[1] * before +
             section.end[1] * after;
      y = next;
    } else {
      y = section.phi[0] * y + section.start[0] * before + section.end[0] * after;
      rate = (after - y) * section.omega;
    }
    before = was;
    after = y;
  }
}

template <class T>
T FilterChain::output_rate(const FilterMemory<T>& memory) const {
  return count_ == 0 ? memory.input_rate : memory.section[count_ - 1][1];
}

template <class T>
T FilterChain::output_acceleration(const FilterMemory<T>& memory) const {
  if (count_ == 0 || !sections_[count_ - 1].second_order) return T(0.0);
  const Section& last = sections_[count_ - 1];
  const T& input = count_ > 1 ? memory.section[count_ - 2][0] : memory.input;
  const auto& [y, rate] = memory.section[count_ - 1];
  return (input - y) * (last.omega * last.omega) - rate * last.damping;
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
  for (std::size_t i = 0; i < count_; ++i) {
    const Section& section = sections_[i];
    lag += section.second_order ? section.damping / (section.omega * section.omega)
                                : 1.0 / section.omega;
  }
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
    : displacement_(model.sensors[index_of(Channel::displacement)].filters, step_s),
      velocity_(model.sensors[index_of(Channel::velocity)].filters, step_s),
      friction_force_(model.sensors[index_of(Channel::friction_force)].filters, step_s),
      normal_load_(model.sensors[index_of(Channel::normal_load)].filters, step_s) {}

template <class T>
void SensorBank::settle(SensorMemory<T>& memory, const Quantities<T>& q) const {
  displacement_.settle(memory.displacement, q.displacement, q.velocity);
  velocity_.settle(memory.velocity, q.velocity, T(0.0));
  friction_force_.settle(memory.friction_force, q.friction_reading, T(0.0));
  normal_load_.settle(memory.normal_load, q.normal_load, T(0.0));
}

template <class T>
void SensorBank::advance(SensorMemory<T>& memory, const Quantities<T>& q) const {
  displacement_.advance(memory.displacement, q.displacement, q.velocity);
  velocity_.advance(memory.velocity, displacement_.output_rate(memory.displacement), T(0.0));
  friction_force_.advance(memory.friction_force, q.friction_reading, T(0.0));
  normal_load_.advance(memory.normal_load, q.normal_load, T(0.0));
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

template void FilterChain::settle(FilterMemory<double>&, const double&, const double&) const;
template void FilterChain::settle(FilterMemory<Dual>&, const Dual&, const Dual&) const;
template void FilterChain::advance(FilterMemory<double>&, const double&, const double&) const;
template void FilterChain::advance(FilterMemory<Dual>&, const Dual&, const Dual&) const;
template double FilterChain::output_rate(const FilterMemory<double>&) const;
template Dual FilterChain::output_rate(const FilterMemory<Dual>&) const;
template double FilterChain::output_acceleration(const FilterMemory<double>&) const;
template Dual FilterChain::output_acceleration(const FilterMemory<Dual>&) const;
template void SensorBank::settle(SensorMemory<double>&, const Quantities<double>&) const;
template void SensorBank::settle(SensorMemory<Dual>&, const Quantities<Dual>&) const;
template void SensorBank::advance(SensorMemory<double>&, const Quantities<double>&) const;
template void SensorBank::advance(SensorMemory<Dual>&, const Quantities<Dual>&) const;
template Readings<double> SensorBank::readings(const SensorMemory<double>&) const;
template Readings<Dual> SensorBank::readings(const SensorMemory<Dual>&) const;

}  // namespace stickslip::physics
