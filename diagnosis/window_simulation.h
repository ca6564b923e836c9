// SPDX-License-Identifier: Apache-2.0
// Integration of a rig over one window of a recording, for plain numbers and for numbers with
// derivatives.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
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
  using Knots = std::array<T, max_drive_knots>;
  DriveError(const Experiment& e, const Window& window, const Knots& knots)
      : knots_(knots),
        noise_(e.drive_noise),
        last_knot_(e.drive_knots - 1),
        span_s_(static_cast<double>(window.end - window.warm) * e.period_s) {}
  /// 0 after the end of the window.
  T at(double since_warm_s) const {
    if (!(noise_ > 0.0) || since_warm_s > span_s_) return T(0.0);
    const double position = std::min(since_warm_s / span_s_, 0.999999) * last_knot_;
    const auto left = static_cast<std::size_t>(position);
    const double share = position - static_cast<double>(left);
    return (noise_ * (1.0 - share)) * knots_[left] + (noise_ * share) * knots_[left + 1];
  }

 private:
  const Knots& knots_;
  double noise_;
  double last_knot_;
  double span_s_;
};

/// A window's free state with derivatives, or plain.
template <class T>
struct WindowStart {
  physics::RigState<T> rig;
  std::array<T, max_drive_knots> knots{};

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

/// Times at which the readings of a window were taken, in order for each channel: those of the
/// samples, less the delay of the channel, which may be other than a whole number of steps.
template <class T>
class MeasurementTimes {
 public:
  MeasurementTimes(const Experiment& e, const Window& window, std::size_t end,
                   const physics::ReadingLaws<T>& laws)
      : e_(e), warm_(window.warm), end_(end), most_shares_(1.0 + 2.0 * e.substeps) {
    next_.fill(window.begin);
    if (!laws.any_delay) return;
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      delay_[c] = laws.of[c].delay_s;
      // Only the derivatives: the value is part of the time.
      delay_[c] -= physics::value_of(delay_[c]);
      delay_s_[c] = physics::value_of(laws.of[c].delay_s);
    }
  }
  bool complete() const {
    return std::all_of(next_.begin(), next_.end(), [this](std::size_t k) { return k >= end_; });
  }
  bool is_due(double since_warm_s) const {
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (next_[c] < end_ && at(c) <= since_warm_s) return true;
    }
    return false;
  }
  /// Calls sink(sample, channel, reading, rate) for the readings due until `since_warm_s`, between
  /// `before`, `step_s` earlier, and `after`.
  template <class Sink>
  void pass(const std::array<T, predicted_channels>& before,
            const std::array<T, predicted_channels>& after, double since_warm_s, double step_s,
            Sink&& sink) {
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      const double rate = (physics::value_of(after[c]) - physics::value_of(before[c])) / step_s;
      for (; next_[c] < end_ && at(c) <= since_warm_s; ++next_[c]) {
        // Above 1 before the first step of a window: a late channel shows what preceded it.
        const double share = std::clamp((since_warm_s - at(c)) / step_s, 0.0, most_shares_);
        T value = after[c];
        if (share > 1.0e-6) value += (before[c] - after[c]) * share;
        if (delay_s_[c] != 0.0 || is_dual) value -= rate * delay_[c];
        sink(next_[c], c, value, rate);
      }
    }
  }

 private:
  static constexpr bool is_dual = !std::is_same_v<T, double>;

  double at(std::size_t c) const {
    const std::size_t k = next_[c];
    const double jitter_s = e_.measured_after_s.empty() ? 0.0 : double{e_.measured_after_s[k][c]};
    const double rounding_s = 1.0e-9 * e_.period_s;
    return e_.period_s * static_cast<double>(k - warm_) + jitter_s - delay_s_[c] - rounding_s;
  }

  const Experiment& e_;
  std::size_t warm_;
  std::size_t end_;
  double most_shares_;
  std::array<std::size_t, predicted_channels> next_{};
  std::array<T, predicted_channels> delay_{};
  std::array<double, predicted_channels> delay_s_{};
};

/// Predicted channels in their order.
template <class T>
std::array<T, predicted_channels> as_array(const physics::Readings<T>& r) {
  return {r.displacement, r.velocity, r.friction_force, r.normal_load};
}

/// The sensors of a rig in one window: chains, and errors other than a delay.
template <class T>
class WindowSensors {
 public:
  WindowSensors(const physics::SensorBank& bank, physics::ReadingLaws<T> laws, double step_s)
      : bank_(bank), wrong_(laws.any_error) {
    laws.any_delay = false;
    if (wrong_) errors_.emplace(laws, bank, step_s);
  }
  void settle(const physics::Quantities<T>& quantities) {
    bank_.settle(chains_, quantities);
    if (wrong_) errors_->settle(memory_, chains_);
  }
  void advance(const physics::Quantities<T>& quantities) {
    bank_.advance(chains_, quantities);
    if (wrong_) errors_->advance(memory_, chains_);
  }
  std::array<T, predicted_channels> readings(double time_s) const {
    return as_array(wrong_ ? errors_->readings(memory_, chains_, time_s) : bank_.readings(chains_));
  }

 private:
  const physics::SensorBank& bank_;
  bool wrong_;
  std::optional<physics::SensorErrors<T>> errors_;
  physics::SensorMemory<T> chains_;
  physics::SensorErrorState<T> memory_;
};

/// Integrates from `from` at window.warm until all readings from window.begin to before `end` were
/// taken, and calls sink(sample, channel, reading, its rate) for each, those of one channel in
/// order.
template <class T, class Sink>
void run_window(const Experiment& e, const Window& window, std::size_t end, const physics::Rig& rig,
                const physics::SensorBank& bank, const physics::RigNumbers<T>& n,
                const WindowStart<T>& from, Sink&& sink) {
  physics::RigState<T> s = from.rig;
  const DriveError<T> drive_error(e, window, from.knots);
  const bool imposed = rig.structure().excitation == physics::Excitation::imposed;
  const double h = e.period_s / e.substeps;
  const std::size_t first = window.warm * static_cast<std::size_t>(e.substeps);
  const double start_time = e.elapsed_s(window.warm);
  const DelayedInput<T> input(e.input, n, rig.structure().excitation, h);
  physics::Input now = input.at(first);
  rig.complete(s, now, start_time, n);
  WindowSensors<T> sensors(bank, n.reading, h);
  sensors.settle(rig.quantities(s, now, n));
  MeasurementTimes<T> times(e, window, end, n.reading);
  std::array<T, predicted_channels> after = sensors.readings(start_time);
  for (std::size_t at = first; !times.complete(); ++at) {
    if (at + 1 >= e.input.size()) {
      // A channel that leads has no reading at the very end of the recording: the last one counts.
      times.pass(after, after, std::numeric_limits<double>::infinity(), h, sink);
      return;
    }
    const double since_warm = static_cast<double>(at - first) * h;
    const bool due = times.is_due(since_warm + h);  // the first step: those of its beginning, too
    const std::array<T, predicted_channels> before =
        due ? sensors.readings(start_time + since_warm) : after;
    const physics::Input next = input.at(at + 1);
    const T error = drive_error.at(since_warm + 0.5 * h);
    s.unrecorded = input.lead_term(now, next) + error;
    if (imposed) s.s[physics::state::v] = now.velocity_m_s + error;
    rig.step(s, now, next, start_time + since_warm, h, n);
    now = next;
    sensors.advance(rig.quantities(s, now, n));
    if (!due) continue;
    after = sensors.readings(start_time + since_warm + h);
    times.pass(before, after, since_warm + h, h, sink);
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
  if (driving == Channel::drive_force) n.input_offset_n = n.reading.of[index_of(driving)].offset;
  const physics::ReadingLaw<T>& load = n.reading.of[index_of(Channel::normal_load)];
  n.load_gain = 1.0 / load.gain;
  n.load_offset_n = load.offset;
  return n;
}

}  // namespace stickslip::diagnosis
