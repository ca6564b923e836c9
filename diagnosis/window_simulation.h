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

/// A window to be integrated, until the readings from its begin to before `end` were taken, which
/// may lie beyond the window's own.
struct WindowRun {
  const Experiment& e;
  const Window& window;
  std::size_t end = 0;
  Steps steps = Steps::fine;

  double step_s() const { return e.period_s / e.steps_per_sample(steps); }
  /// Elements of Experiment::input from one step to the next.
  std::size_t stride() const {
    return static_cast<std::size_t>(e.substeps / e.steps_per_sample(steps));
  }
  /// Element of Experiment::input with which the integration begins.
  std::size_t first_input() const { return window.warm * static_cast<std::size_t>(e.substeps); }
};

/// Error of the drive in a window (Experiment::drive_noise): a linear spline through its knots.
class DriveError {
 public:
  /// The error between two knots: shares of theirs.
  struct Shares {
    std::size_t left = 0;
    double of_left = 0.0;
    double of_right = 0.0;

    double of(const WindowState& knots) const {
      const std::size_t first = physics::max_rig_states + left;
      return of_left * knots[first] + of_right * knots[first + 1];
    }
  };
  DriveError(const Experiment& e, const Window& window)
      : noise_(e.drive_noise),
        last_knot_(e.drive_knots - 1),
        span_s_(static_cast<double>(window.end - window.warm) * e.period_s) {}
  /// No share after the end of the window.
  Shares at(double since_warm_s) const {
    if (!(noise_ > 0.0) || since_warm_s > span_s_) return {};
    const double position = std::min(since_warm_s / span_s_, 0.999999) * last_knot_;
    const auto left = static_cast<std::size_t>(position);
    const double share = position - static_cast<double>(left);
    return {left, noise_ * (1.0 - share), noise_ * share};
  }

 private:
  double noise_;
  double last_knot_;
  double span_s_;
};

/// The inputs of a window as they acted, corrected for the delay of their own channel and the
/// cut-offs of its filters.
template <class T>
class CorrectedInput {
 public:
  CorrectedInput(const WindowRun& run, const physics::RigNumbers<T>& n,
                 physics::Excitation excitation)
      : recorded_(run.e.input),
        higher_cutoff_(run.e.input_at_higher_cutoff),
        excitation_(excitation),
        is_late_(n.reading.any_delay),
        steps_(physics::value_of(n.input_lead_s) * run.e.substeps / run.e.period_s),
        share_(higher_cutoff_.empty()
                   ? 0.0
                   : physics::value_of(n.input_cutoff_change) / Experiment::higher_cutoff) {
    // The input is linear between its values: its derivative with respect to the lead is its slope.
    per_step_ =
        n.input_gain * (n.input_lead_s - physics::value_of(n.input_lead_s)) * (1.0 / run.step_s());
    per_share_ = n.input_gain * (n.input_cutoff_change - physics::value_of(n.input_cutoff_change)) *
                 (1.0 / Experiment::higher_cutoff);
  }
  physics::Input at(std::size_t element) const {
    if (!is_late_) return recorded_[element];
    const physics::Input recorded = delayed(recorded_, element);
    if (share_ == 0.0) return recorded;
    return physics::between(recorded, delayed(higher_cutoff_, element), share_);
  }
  /// Contribution of the derivatives with respect to lead and cut-offs in the step from `now`,
  /// which is `element`, to `next`.
  T derivative_term(std::size_t element, const physics::Input& now,
                    const physics::Input& next) const {
    if (!is_late_) return T(0.0);
    T out = per_step_ * (drive_of(next) - drive_of(now));
    if (!higher_cutoff_.empty()) {
      out += per_share_ * (drive_of(higher_cutoff_[element]) - drive_of(recorded_[element]));
    }
    return out;
  }

 private:
  physics::Input delayed(const std::vector<physics::Input>& input, std::size_t element) const {
    if (steps_ == 0.0) return input[element];
    const double last = static_cast<double>(input.size() - 1);
    const double position = std::clamp(static_cast<double>(element) + steps_, 0.0, last);
    const auto before = std::min(static_cast<std::size_t>(position), input.size() - 2);
    return physics::between(input[before], input[before + 1],
                            position - static_cast<double>(before));
  }
  double drive_of(const physics::Input& input) const {
    switch (excitation_) {
      case physics::Excitation::force:
        return input.drive_force_n;
      case physics::Excitation::imposed:
        return input.velocity_m_s;
      case physics::Excitation::base:
        break;
    }
    return input.base_acceleration_m_s2;
  }

  const std::vector<physics::Input>& recorded_;
  const std::vector<physics::Input>& higher_cutoff_;
  physics::Excitation excitation_;
  bool is_late_;
  double steps_;
  double share_;  // of the way to the higher cut-off
  T per_step_{0.0};
  T per_share_{0.0};
};

/// Times at which the readings of a window were taken, in order for each channel: those of the
/// samples, less the delay of the channel, which may be other than a whole number of steps.
template <class T>
class MeasurementTimes {
 public:
  MeasurementTimes(const WindowRun& run, const physics::ReadingLaws<T>& laws)
      : e_(run.e),
        warm_(run.window.warm),
        end_(run.end),
        most_shares_(1.0 + 2.0 * run.e.steps_per_sample(run.steps)) {
    next_.fill(run.window.begin);
    if (!laws.any_delay) return;
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      // The lag of the filters is that of their own states.
      delay_[c] = laws.of[c].delay_s - laws.of[c].lag_s;
      delay_s_[c] = physics::value_of(delay_[c]);
      // Only the derivatives: the value is part of the time.
      delay_[c] -= delay_s_[c];
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

/// Factors of the cut-offs of the channels' filters.
template <class T>
physics::CutoffChanges<T> cutoff_scales(const physics::ReadingLaws<T>& laws) {
  physics::CutoffChanges<T> out;
  for (std::size_t c = 0; c < out.size(); ++c) out[c] = 1.0 / (1.0 - laws.of[c].cutoff_change);
  return out;
}

/// The sensors of a model with the cut-offs of the laws, for steps of a run.
inline physics::SensorBank sensor_bank(const physics::Model& model,
                                       const physics::ReadingLaws<double>& laws, double step_s) {
  return {model, step_s, cutoff_scales(laws)};
}

/// The sensors of a rig in one window: chains, and errors other than a delay.
template <class T>
class WindowSensors {
 public:
  WindowSensors(const physics::SensorBank& bank, physics::ReadingLaws<T> laws, double step_s)
      : bank_(bank), wrong_(laws.any_error), changes_(cutoff_scales(laws)) {
    for (T& each : changes_) each = each * (1.0 / physics::value_of(each)) - 1.0;
    laws.any_delay = false;
    if (wrong_) errors_.emplace(laws, bank, step_s);
  }
  void settle(const physics::Quantities<T>& quantities) {
    bank_.settle(chains_, quantities, changes());
    if (wrong_) errors_->settle(memory_, chains_);
  }
  void advance(const physics::Quantities<T>& quantities) {
    bank_.advance(chains_, quantities, changes());
    if (wrong_) errors_->advance(memory_, chains_);
  }
  std::array<T, predicted_channels> readings(double time_s) const {
    return as_array(wrong_ ? errors_->readings(memory_, chains_, time_s) : bank_.readings(chains_));
  }

 private:
  // Derivatives only: the bank has the cut-offs themselves.
  const physics::CutoffChanges<T>* changes() const {
    return std::is_same_v<T, double> ? nullptr : &changes_;
  }

  const physics::SensorBank& bank_;
  bool wrong_;
  physics::CutoffChanges<T> changes_;
  std::optional<physics::SensorErrors<T>> errors_;
  physics::SensorMemory<T> chains_;
  physics::SensorErrorState<T> memory_;
};

/// The readings of a window, taken while a rig moves through it.
template <class T>
class WindowReader {
 public:
  /// Calls of a sink are sink(sample, channel, reading, its rate), those of one channel in order.
  WindowReader(const WindowRun& run, const physics::SensorBank& bank,
               const physics::ReadingLaws<T>& laws)
      : sensors_(bank, laws, run.step_s()),
        times_(run, laws),
        start_time_(run.e.elapsed_s(run.window.warm)),
        step_s_(run.step_s()) {}
  void settle(const physics::Quantities<T>& quantities) {
    sensors_.settle(quantities);
    after_ = sensors_.readings(start_time_);
  }
  bool complete() const { return times_.complete(); }
  /// One step from `since_warm_s`, to these quantities at its end.
  template <class Sink>
  void advance(const physics::Quantities<T>& quantities, double since_warm_s, Sink&& sink) {
    const double until = since_warm_s + step_s_;
    const bool due = times_.is_due(until);  // the first step: those of its beginning, too
    const Channels before = due ? sensors_.readings(start_time_ + since_warm_s) : after_;
    sensors_.advance(quantities);
    if (!due) return;
    after_ = sensors_.readings(start_time_ + until);
    times_.pass(before, after_, until, step_s_, sink);
  }
  /// A channel that leads has no reading at the very end of a recording: the last one counts.
  template <class Sink>
  void finish(Sink&& sink) {
    times_.pass(after_, after_, std::numeric_limits<double>::infinity(), step_s_, sink);
  }

 private:
  using Channels = std::array<T, predicted_channels>;
  WindowSensors<T> sensors_;
  MeasurementTimes<T> times_;
  double start_time_;
  double step_s_;
  Channels after_{};
};

/// One step of a window's integration.
struct WindowStep {
  physics::Input now, next;
  std::size_t element = 0;  ///< of Experiment::input, of `now`
  double time_s = 0.0;
  double length_s = 0.0;
  DriveError::Shares error;  ///< of the drive, at its middle
};

/// Moves a rig from window.warm through the steps of a window: motion.advance(WindowStep), then
/// read(time since window.warm at which the step began), until complete(). False if the recording
/// ended before.
template <class Motion, class Read, class Complete>
bool run_steps(const WindowRun& run, const CorrectedInput<double>& input, Motion& motion,
               Read&& read, Complete&& complete) {
  const double start_time = run.e.elapsed_s(run.window.warm);
  const DriveError error(run.e, run.window);
  const std::size_t stride = run.stride();
  WindowStep step;
  step.length_s = run.step_s();
  std::size_t at = run.first_input();
  step.next = input.at(at);
  for (std::size_t i = 0; !complete(); ++i) {
    step.element = at;
    at += stride;
    if (at >= run.e.input.size()) return false;
    const double since_warm = static_cast<double>(i) * step.length_s;
    step.now = step.next;
    step.next = input.at(at);
    step.time_s = start_time + since_warm;
    step.error = error.at(since_warm + 0.5 * step.length_s);
    motion.advance(step);
    read(since_warm);
  }
  return true;
}

/// The motion of a rig by itself.
class PlainMotion {
 public:
  /// Begins with the input `now` at `time_s`; `from` must outlive it.
  PlainMotion(const physics::Rig& rig, const physics::RigNumbers<double>& n,
              const WindowState& from, const physics::Input& now, double time_s)
      : rig_(rig), n_(n), from_(from), now_(now) {
    std::copy_n(from.begin(), s_.s.size(), s_.s.begin());
    rig_.complete(s_, now, time_s, n_);
  }
  void advance(const WindowStep& step) {
    s_.unrecorded = step.error.of(from_);
    if (rig_.structure().excitation == physics::Excitation::imposed) {
      s_.s[physics::state::v] = step.now.velocity_m_s + s_.unrecorded;
    }
    rig_.step(s_, step.now, step.next, step.time_s, step.length_s, n_);
    now_ = step.next;
  }
  physics::Quantities<double> quantities() const { return rig_.quantities(s_, now_, n_); }

 private:
  const physics::Rig& rig_;
  const physics::RigNumbers<double>& n_;
  const WindowState& from_;
  physics::RigState<double> s_;
  physics::Input now_;
};

/// Integrates from `from` at window.warm, and calls sink(sample, channel, reading, its rate) for
/// each reading, those of one channel in order. `bank`: for the steps of the run, with the cut-offs
/// of the numbers.
template <class Sink>
void run_window(const WindowRun& run, const physics::Rig& rig, const physics::SensorBank& bank,
                const physics::RigNumbers<double>& n, const WindowState& from, Sink&& sink) {
  const CorrectedInput<double> input(run, n, rig.structure().excitation);
  PlainMotion motion(rig, n, from, input.at(run.first_input()), run.e.elapsed_s(run.window.warm));
  WindowReader<double> reader(run, bank, n.reading);
  reader.settle(motion.quantities());
  const bool whole = run_steps(
      run, input, motion,
      [&](double since_warm) { reader.advance(motion.quantities(), since_warm, sink); },
      [&] { return reader.complete(); });
  if (!whole) reader.finish(sink);
}

/// The numbers of a rig driven by recorded inputs, which were read with the gain and the delay of
/// their channel.
template <class T>
physics::RigNumbers<T> numbers_on_recording(const physics::Rig& rig,
                                            std::span<const T> parameters) {
  physics::RigNumbers<T> n = rig.numbers<T>(parameters);
  const Channel driving = drive_channel(rig.structure().excitation);
  const T& gain = n.reading.of[index_of(driving)].gain;
  if (physics::value_of(gain) != 1.0 || n.reading.any_error) n.input_gain = 1.0 / gain;
  n.input_lead_s = n.reading.of[index_of(driving)].delay_s;
  n.input_cutoff_change = n.reading.of[index_of(driving)].cutoff_change;
  if (driving == Channel::drive_force) n.input_offset_n = n.reading.of[index_of(driving)].offset;
  const physics::ReadingLaw<T>& load = n.reading.of[index_of(Channel::normal_load)];
  n.load_gain = 1.0 / load.gain;
  n.load_offset_n = load.offset;
  return n;
}

}  // namespace stickslip::diagnosis
