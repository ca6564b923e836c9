// SPDX-License-Identifier: Apache-2.0
// Sensor chains: analogue low-pass filters between a quantity and its reading, discretised exactly
// for inputs that are linear between steps (first-order hold).
#pragma once

#include <array>
#include <complex>
#include <span>

#include "physics/frame.h"
#include "physics/model.h"
#include "physics/rig.h"

namespace stickslip::physics {

inline constexpr std::size_t max_filter_sections = 6;

/// State of a chain: output and its rate per section, and the last input.
template <class T>
struct FilterMemory {
  std::array<std::array<T, 2>, max_filter_sections> section{};
  T input{0.0};
  T input_rate{0.0};
};

/// A chain of filters for one step length. Immutable; owns no heap memory.
class FilterChain {
 public:
  FilterChain() = default;
  /// Throws std::invalid_argument where the filters need more than max_filter_sections sections
  /// (one for two orders).
  FilterChain(std::span<const Filter> filters, double step_s);

  bool empty() const { return count_ == 0; }

  /// The state of a chain whose input has always been value + rate (t - now).
  template <class T>
  void settle(FilterMemory<T>& memory, const T& value, const T& rate) const;

  /// Advances by one step, at the end of which the input is `input` with slope `input_rate` (used
  /// by an empty chain only).
  template <class T>
  void advance(FilterMemory<T>& memory, const T& input, const T& input_rate) const;

  template <class T>
  const T& output(const FilterMemory<T>& memory) const {
    return count_ == 0 ? memory.input : memory.section[count_ - 1][0];
  }

  /// The exact time derivative of the output.
  template <class T>
  T output_rate(const FilterMemory<T>& memory) const;

  /// The input of the chain's last section where that is of first order, else the output.
  template <class T>
  const T& before_last_pole(const FilterMemory<T>& memory) const {
    if (count_ == 0 || sections_[count_ - 1].second_order) return output(memory);
    return count_ > 1 ? memory.section[count_ - 2][0] : memory.input;
  }

  /// The exact second derivative of the output; 0 for a chain whose last section has one pole or
  /// that is empty.
  template <class T>
  T output_acceleration(const FilterMemory<T>& memory) const;

  /// Transfer function at that frequency [Hz].
  std::complex<double> response(double frequency_hz) const;
  /// Transfer function at the complex frequency `s` [rad/s]; infinite at its poles.
  std::complex<double> transfer(std::complex<double> s) const;

  /// Delay of slow signals [s].
  double lag_s() const;

  /// Time after which initial conditions have decayed to about 0.2 %.
  double settling_time_s() const;

 private:
  struct Section {
    bool second_order = false;
    double omega = 0.0;             ///< [rad/s]
    double damping = 0.0;           ///< 2 zeta omega, second order [rad/s]
    std::array<double, 4> phi{};    ///< row-major state transition
    std::array<double, 2> start{};  ///< weight of the input at the start of the step
    std::array<double, 2> end{};    ///< weight of the input at its end
  };
  std::array<Section, max_filter_sections> sections_{};
  std::size_t count_ = 0;
};

/// Readings of the mechanical channels of a rig.
template <class T>
struct Readings {
  T displacement{0.0};
  T velocity{0.0};
  T friction_force{0.0};
  T normal_load{0.0};
};

template <class T>
struct SensorMemory {
  FilterMemory<T> displacement, velocity, friction_force, normal_load;
};

/// The sensor chains of the four mechanical channels. The velocity chain continues the displacement
/// chain: the input of the analogue differentiator is the filtered displacement.
class SensorBank {
 public:
  SensorBank(const Model& model, double step_s);

  template <class T>
  void settle(SensorMemory<T>& memory, const Quantities<T>& quantities) const;
  template <class T>
  void advance(SensorMemory<T>& memory, const Quantities<T>& quantities) const;
  template <class T>
  Readings<T> readings(const SensorMemory<T>& memory) const;

  /// The differentiated displacement before the differentiator's roll-off, which is the first-order
  /// filter at the end of the velocity chain, if there is one.
  template <class T>
  const T& velocity_before_roll_off(const SensorMemory<T>& memory) const {
    return velocity_.before_last_pole(memory.velocity);
  }

  const FilterChain& chain(Channel channel) const;
  /// The longest settling time of the four channels.
  double settling_time_s() const;

 private:
  FilterChain displacement_, velocity_, friction_force_, normal_load_;
};

}  // namespace stickslip::physics
