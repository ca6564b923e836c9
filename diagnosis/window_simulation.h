// Integration of a rig over one window of a recording, for plain numbers and for numbers with
// derivatives.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "diagnosis/experiment.h"
#include "diagnosis/shooting.h"
#include "physics/dual.h"
#include "physics/reading.h"
#include "physics/rig.h"
#include "physics/sensor_chain.h"

namespace stickslip::diagnosis {

/// Error of the base's acceleration in a window: a linear spline whose value is 0 and whose
/// derivatives are those with respect to its knots, scaled by `height`.
class BaseKnots {
 public:
  BaseKnots(const Experiment& e, const Window& window, double height)
      : height_(height),
        per_s_((base_knots - 1) / (static_cast<double>(window.end - window.warm) * e.period_s)) {}
  physics::Dual at(double since_warm_s) const {
    static_assert(base_knots <= physics::Dual::directions);
    const double position = std::min(since_warm_s * per_s_, base_knots - 1.000001);
    const auto left = static_cast<Eigen::Index>(position);
    const double share = position - static_cast<double>(left);
    physics::Dual sum;
    sum.d[left] = physics::Dual::slope(height_ * (1.0 - share));
    sum.d[left + 1] = physics::Dual::slope(height_ * share);
    return sum;
  }

 private:
  double height_;
  double per_s_;
};

struct NoKnots {
  double at(double /*since_warm_s*/) const { return 0.0; }
};

/// The inputs of a window as they acted, corrected for the delay of their own channel.
template <class T>
class DelayedInput {
 public:
  DelayedInput(const std::vector<physics::Input>& recorded, const physics::RigNumbers<T>& n,
               physics::Excitation excitation, double step_s)
      : recorded_(recorded),
        of_force_(excitation == physics::Excitation::force),
        is_late_(n.reading.any_delay),
        steps_(physics::value_of(n.input_lead_s) / step_s) {
    // The input is linear between its values: its derivative with respect to the lead is its slope.
    per_step_ =
        n.input_gain * (n.input_lead_s - physics::value_of(n.input_lead_s)) * (1.0 / step_s);
  }
  physics::Input at(std::size_t step) const {
    if (!is_late_ || steps_ == 0.0) return recorded_[step];
    const double last = static_cast<double>(recorded_.size() - 1);
    const double position = std::clamp(static_cast<double>(step) + steps_, 0.0, last);
    const auto before = std::min(static_cast<std::size_t>(position), recorded_.size() - 2);
    return physics::between(recorded_[before], recorded_[before + 1],
                            position - static_cast<double>(before));
  }
  /// Contribution of the derivative with respect to the lead, from `now` to `next`.
  T lead_term(const physics::Input& now, const physics::Input& next) const {
    if (!is_late_) return T(0.0);
    return per_step_ * (of_force_ ? next.drive_force_n - now.drive_force_n
                                  : next.base_acceleration_m_s2 - now.base_acceleration_m_s2);
  }

 private:
  const std::vector<physics::Input>& recorded_;
  bool of_force_;
  bool is_late_;
  double steps_;
  T per_step_{0.0};
};

/// Integrates from `s` at window.warm to `end` and calls sink(sample, readings) from window.begin
/// on.
template <class T, class Sink, class Knots = NoKnots>
void run_window(const Experiment& e, const Window& window, std::size_t end, const physics::Rig& rig,
                const physics::SensorBank& bank, const physics::RigNumbers<T>& n,
                physics::RigState<T> s, Sink&& sink, const Knots& knots = {}) {
  const bool wrong = n.reading.any_error;
  std::optional<physics::SensorErrors<T>> faults;
  physics::SensorErrorState<T> fault_memory;
  const double h = e.period_s / e.substeps;
  const auto substeps = static_cast<std::size_t>(e.substeps);
  physics::SensorMemory<T> memory;
  std::size_t at = window.warm * substeps;
  const double start_time = e.period_s * static_cast<double>(window.warm);
  const DelayedInput<T> input(e.input, n, rig.structure().excitation, h);
  physics::Input now = input.at(at);
  rig.complete(s, now, start_time, n);
  bank.settle(memory, rig.quantities(s, now, n));
  if (wrong) {
    faults.emplace(n.reading, bank, h);
    faults->settle(fault_memory, memory);
  }
  for (std::size_t k = window.warm; k < end; ++k) {
    if (k >= window.begin) {
      sink(k, wrong ? faults->readings(fault_memory, memory, e.period_s * static_cast<double>(k))
                    : bank.readings(memory));
    }
    if (k + 1 == end) break;
    for (std::size_t j = 0; j < substeps; ++j, ++at) {
      const double time = start_time + static_cast<double>(at - window.warm * substeps) * h;
      const physics::Input next = input.at(at + 1);
      s.unrecorded = input.lead_term(now, next) + knots.at(time - start_time + 0.5 * h);
      rig.step(s, now, next, time, h, n);
      now = next;
      bank.advance(memory, rig.quantities(s, now, n));
      if (wrong) faults->advance(fault_memory, memory);
    }
  }
}

/// The numbers of a rig driven by recorded inputs, which were read with the gain and the delay of
/// their channel.
template <class T>
physics::RigNumbers<T> numbers_on_recording(const physics::Rig& rig,
                                            std::span<const T> parameters) {
  physics::RigNumbers<T> n = rig.numbers<T>(parameters);
  const Channel driving = rig.structure().excitation == physics::Excitation::force
                              ? Channel::drive_force
                              : Channel::base_displacement;
  const T& gain = n.reading.of[index_of(driving)].gain;
  if (physics::value_of(gain) != 1.0 || n.reading.any_error) n.input_gain = 1.0 / gain;
  n.input_lead_s = n.reading.of[index_of(driving)].delay_s;
  return n;
}

/// Predicted channels in their order.
template <class T>
std::array<T, predicted_channels> as_array(const physics::Readings<T>& r) {
  return {r.displacement, r.velocity, r.friction_force, r.normal_load};
}

}  // namespace stickslip::diagnosis
