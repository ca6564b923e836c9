// SPDX-License-Identifier: Apache-2.0
// Sensor chains: analogue low-pass filters between a quantity and its reading, discretised exactly
// for inputs that are linear (first-order hold) or cubic between steps.
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

/// The course of a chain's input between steps. Linear: between its values, which attenuates a
/// frequency f by (2 pi f h)^2 / 12 for steps h. Cubic: with its slopes at the steps, too, for
/// smooth inputs whose slopes are known; attenuates by (2 pi f h)^4 / 720.
enum class InputCourse { linear, cubic };

/// A chain of filters for one step length. Immutable; owns no heap memory.
class FilterChain {
 public:
  FilterChain() = default;
  /// Throws std::invalid_argument where the filters need more than max_filter_sections sections
  /// (one for two orders). Its cut-offs are `scale` times those of the filters.
  FilterChain(std::span<const Filter> filters, double step_s,
              InputCourse course = InputCourse::linear, double scale = 1.0);

  /// Lets advance and settle take a relative change of the cut-offs.
  void allow_changes();

  bool empty() const { return count_ == 0; }

  /// The state of a chain whose input has always been value + rate (t - now). `change`: derivatives
  /// of the relative change of the cut-offs, whose value is 0; nullptr: none.
  template <class T>
  void settle(FilterMemory<T>& memory, const T& value, const T& rate,
              const T* change = nullptr) const;

  /// Advances by one step, at the end of which the input is `input` with slope `input_rate` (used
  /// by an empty chain and for a cubic course only). `change` as in settle.
  template <class T>
  void advance(FilterMemory<T>& memory, const T& input, const T& input_rate,
               const T* change = nullptr) const;

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

  /// The exact second derivative of the output; 0 for an empty chain. Where the last section has
  /// one pole, that of an input with the slope last given. `change` as in settle.
  template <class T>
  T output_acceleration(const FilterMemory<T>& memory, const T* change = nullptr) const;

  /// Transfer function at that frequency [Hz].
  std::complex<double> response(double frequency_hz) const;
  /// Transfer function at the complex frequency `s` [rad/s]; infinite at its poles.
  std::complex<double> transfer(std::complex<double> s) const;

  /// Delay of slow signals [s].
  double lag_s() const;

  /// Time after which initial conditions have decayed to about 0.2 %.
  double settling_time_s() const;

 private:
  template <class T>
  using Value = std::array<T, 2>;  // a value and its rate
  struct Section {
    bool second_order = false;
    bool cubic = false;             ///< the course of the input
    double omega = 0.0;             ///< [rad/s]
    double damping = 0.0;           ///< 2 zeta omega, second order [rad/s]
    std::array<double, 4> phi{};    ///< row-major state transition
    std::array<double, 2> start{};  ///< weight of the input at the start of the step
    std::array<double, 2> end{};    ///< weight of the input at its end
    /// Weights of the input's slopes there; 0 for linear inputs.
    std::array<double, 2> start_rate{}, end_rate{};
    double lag_s = 0.0;

    /// Row of the state after a step: 0 the output, 1 its rate.
    template <class T>
    T next(std::size_t row, const Value<T>& state, const Value<T>& before,
           const Value<T>& after) const;
  };
  Section section_of(bool second_order, double omega, double damping) const;
  template <class T>
  void add_change(std::size_t section, const T& change, const Value<T>& was, const Value<T>& before,
                  const Value<T>& after, Value<T>& state) const;

  double step_s_ = 0.0;
  InputCourse course_ = InputCourse::linear;
  std::array<Section, max_filter_sections> sections_{};
  std::array<Section, max_filter_sections> slopes_{};  // of the coefficients by the change
  std::size_t count_ = 0;
};

/// Of the mechanical channels, in their order.
template <class T>
using CutoffChanges = std::array<T, 4>;

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
/// chain: the input of the analogue differentiator is the filtered displacement. Inputs whose slope
/// follows from the motion are cubic between steps.
class SensorBank {
 public:
  SensorBank(const Model& model, double step_s);
  /// With cut-offs of `scales` times those of the model.
  SensorBank(const Model& model, double step_s, const CutoffChanges<double>& scales);

  /// Lets advance and settle take relative changes of the cut-offs.
  void allow_changes();

  /// `changes`: of the cut-offs, as FilterChain takes them; nullptr: none.
  template <class T>
  void settle(SensorMemory<T>& memory, const Quantities<T>& quantities,
              const CutoffChanges<T>* changes = nullptr) const;
  template <class T>
  void advance(SensorMemory<T>& memory, const Quantities<T>& quantities,
               const CutoffChanges<T>* changes = nullptr) const;
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
