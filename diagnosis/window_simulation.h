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

/// Error of the drive in a window (Experiment::drive_noise): a linear spline through its knots.
template <class T>
class DriveError {
 public:
  using Knots = std::array<T, drive_knots>;
  DriveError(const Experiment& e, const Window& window, const Knots& knots)
      : knots_(knots),
        noise_(e.drive_noise),
        span_s_(static_cast<double>(window.end - window.warm) * e.period_s) {}
  /// 0 after the end of the window.
  T at(double since_warm_s) const {
    if (!(noise_ > 0.0) || since_warm_s > span_s_) return T(0.0);
    const double position = std::min(since_warm_s / span_s_, 0.999999) * (drive_knots - 1);
    const auto left = static_cast<std::size_t>(position);
    const double share = position - static_cast<double>(left);
    return (noise_ * (1.0 - share)) * knots_[left] + (noise_ * share) * knots_[left + 1];
  }

 private:
  const Knots& knots_;
  double noise_;
  double span_s_;
};

/// A window's free state with derivatives, or plain.
template <class T>
struct WindowStart {
  physics::RigState<T> rig;
  std::array<T, drive_knots> knots{};

  explicit WindowStart(const WindowState& from) {
    for (std::size_t i = 0; i < from.size(); ++i) (*this)[i] = T(from[i]);
  }
  T& operator[](std::size_t i) { return i < rig.s.size() ? rig.s[i] : knots[i - rig.s.size()]; }
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
template <class T, class Sink>
void run_window(const Experiment& e, const Window& window, std::size_t end, const physics::Rig& rig,
                const physics::SensorBank& bank, const physics::RigNumbers<T>& n,
                const WindowStart<T>& from, Sink&& sink) {
  physics::RigState<T> s = from.rig;
  const DriveError<T> drive_error(e, window, from.knots);
  const bool wrong = n.reading.any_error;
  const bool imposed = rig.structure().excitation == physics::Excitation::imposed;
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
      const T error = drive_error.at(time - start_time + 0.5 * h);
      s.unrecorded = input.lead_term(now, next) + error;
      if (imposed) s.s[physics::state::v] = now.velocity_m_s + error;
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
