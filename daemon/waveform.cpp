// SPDX-License-Identifier: Apache-2.0
#include "daemon/waveform.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "config/demand.h"
#include "daemon/base_limits.h"

namespace stickslip::daemon {
namespace {

using config::ExcitationKind;

constexpr double two_pi = 2.0 * std::numbers::pi;
constexpr double last_turn = 1.0 - 0x1p-53;
/// Time in which a parameter reaches its rate, or comes to rest from it.
constexpr double ease_s = 0.25;
constexpr double modulation_slew_hz_s = 0.5;
constexpr double depth_slew_per_s = 0.5;
/// Shortest movement of the hand, over its range.
constexpr double min_movement = 0.35;
/// Longest duration of a movement of the hand, over the shortest.
constexpr double longest_duration = 3.0;

double wrapped(double turns) { return turns - std::floor(turns); }

/// Zero slope at both ends.
double smooth_step(double u) { return u * u * (3.0 - 2.0 * u); }

/// Minimum-jerk movement from 0 to 1: zero slope and curvature at both ends.
double hand_step(double u) { return u * u * u * (10.0 + u * (6.0 * u - 15.0)); }

double interpolated(const std::vector<config::EnvelopePoint>& table, double time_s) {
  const auto after = std::upper_bound(
      table.begin(), table.end(), time_s,
      [](double t, const config::EnvelopePoint& point) { return t < point.time_s; });
  if (after == table.begin()) return table.front().amplitude;
  if (after == table.end()) return table.back().amplitude;
  const config::EnvelopePoint& a = *(after - 1);
  const config::EnvelopePoint& b = *after;
  return a.amplitude + (b.amplitude - a.amplitude) * (time_s - a.time_s) / (b.time_s - a.time_s);
}

/// Progress of a sweep from from_hz (0) to to_hz (1).
double sweep_progress(const config::Sweep& sweep, double time_s) {
  const double fraction = time_s / sweep.duration_s;
  switch (sweep.at_end) {
    case config::SweepEnd::hold:
      return std::min(1.0, fraction);
    case config::SweepEnd::back:
      return fraction <= 1.0 ? fraction : std::max(0.0, 2.0 - fraction);
    case config::SweepEnd::repeat:
      break;
  }
  const double cycle = std::fmod(fraction, 2.0);
  return cycle <= 1.0 ? cycle : 2.0 - cycle;
}

double sweep_hz(const config::Sweep& sweep, double progress) {
  return sweep.scale == config::SweepScale::linear
             ? sweep.from_hz + (sweep.to_hz - sweep.from_hz) * progress
             : sweep.from_hz * std::pow(sweep.to_hz / sweep.from_hz, progress);
}

/// SplitMix64: uniform in [0, 1).
double uniform(std::uint64_t& state) {
  state += 0x9e3779b97f4a7c15U;
  std::uint64_t z = state;
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
  return static_cast<double>((z ^ (z >> 31U)) >> 11U) * 0x1p-53;
}

double length_of(const config::Excitation& settings, const DriveFile& file) {
  switch (settings.kind) {
    case ExcitationKind::modulated:
      return settings.envelope.empty() ? 0.0 : settings.envelope.back().time_s;
    case ExcitationKind::sweep:
      return 2.0 * settings.sweep.duration_s;
    case ExcitationKind::chirp:
      return settings.sweep.duration_s + settings.sweep.pause_s;
    case ExcitationKind::file:
      return file.length_s();
    case ExcitationKind::by_hand:
    case ExcitationKind::multisine:
      break;
  }
  return 0.0;
}

}  // namespace

void SlewLimiter::advance(double duration_s, bool may_rise) {
  if (duration_s <= 0.0 || (value_ == target_ && rate_per_s_ == 0.0)) return;
  const double goal = may_rise ? target_ : std::min(target_, value_);
  const double change = slew_per_s_ / ease_s * duration_s * duration_s;
  const double before = rate_per_s_ * duration_s;
  const double gap = goal - value_;
  const double step = std::clamp(
      std::copysign(std::min(braking_step(std::abs(gap), change), slew_per_s_ * duration_s), gap),
      before - change, before + change);
  value_ = step == gap ? goal : value_ + step;
  rate_per_s_ = step == gap && std::abs(gap) <= change ? 0.0 : step / duration_s;
}

Waveform::Waveform(const config::Excitation& settings, double amplitude_slew, DriveFile file)
    : settings_(settings),
      file_(std::move(file)),
      level_(has_tunable(settings, Tunable::amplitude) ? settings.amplitude : 1.0, amplitude_slew),
      carrier_(settings.carrier_hz, settings.carrier_slew_hz_s),
      modulation_hz_(settings.modulation_hz, modulation_slew_hz_s),
      modulation_depth_(settings.modulation_depth, depth_slew_per_s),
      length_s_(length_of(settings, file_)),
      random_(settings.by_hand.seed) {
  if (settings.kind == ExcitationKind::multisine) {
    config::Excitation unit_amplitude = settings;
    unit_amplitude.amplitude = 1.0;
    lines_ = config::lines_of(unit_amplitude);
    line_turns_.assign(lines_.size(), 0.0);
    for (const config::Line& line : settings.multisine.lines) lines_amplitude_ += line.amplitude;
    if (settings.multisine.lines.empty()) lines_amplitude_ = 1.0;
  }
  next_movement();
}

void Waveform::restart() {
  if (settings_.kind == ExcitationKind::modulated || settings_.kind == ExcitationKind::by_hand) {
    return;  // its phase continues
  }
  time_s_ = 0.0;
  phase_turns_ = 0.0;
  over_ = false;
  std::fill(line_turns_.begin(), line_turns_.end(), 0.0);
}

double Waveform::idle_carrier_hz() const {
  return has_tunable(settings_, Tunable::carrier_hz) ? carrier_.value() : 0.0;
}

void Waveform::set(const Setting& setting) {
  const double value = setting.value;
  if (!has_tunable(settings_, setting.tunable) || !std::isfinite(value) || value < 0.0) return;
  switch (setting.tunable) {
    case Tunable::carrier_hz:
      if (value > 0.0) carrier_.set(value);
      break;
    case Tunable::amplitude:
      level_.set(value);
      break;
    case Tunable::modulation_hz:
      modulation_hz_.set(value);
      break;
    case Tunable::modulation_depth:
      if (value <= 1.0) modulation_depth_.set(value);
      break;
  }
}

void Waveform::advance(double duration_s) {
  // The change that reduces the motion comes first, so that the transition between two settings
  // within the limits stays within them.
  const bool carrier_falls = carrier_.target() < carrier_.value();
  const bool level_falls = level_.target() < level_.value();
  carrier_.advance(duration_s, !level_falls);
  level_.advance(duration_s, !carrier_falls);
  switch (settings_.kind) {
    case ExcitationKind::modulated:
      return modulate(duration_s);
    case ExcitationKind::by_hand:
      return modulate_by_hand(duration_s);
    case ExcitationKind::sweep:
      return sweep(duration_s);
    case ExcitationKind::chirp:
      return burst(duration_s);
    case ExcitationKind::multisine:
      return sum_lines(duration_s);
    case ExcitationKind::file:
      return play(duration_s);
  }
}

void Waveform::advance_carrier(double hz, double duration_s) {
  carrier_hz_ = hz;
  phase_turns_ = wrapped(phase_turns_ + hz * duration_s);
}

void Waveform::modulate(double duration_s) {
  advance_carrier(carrier_.value(), duration_s);
  if (settings_.envelope.empty()) {
    modulation_hz_.advance(duration_s);
    modulation_depth_.advance(duration_s);
    modulation_turns_ = wrapped(modulation_turns_ + modulation_hz_.value() * duration_s);
    const double depth = modulation_depth_.value();
    amplitude_ =
        level_.value() * (1.0 - depth / 2.0 + depth / 2.0 * std::cos(two_pi * modulation_turns_));
  } else {
    if (length_s_ > 0.0) {
      time_s_ += duration_s;
      time_s_ = settings_.repeat ? std::fmod(time_s_, length_s_) : std::min(time_s_, length_s_);
      modulation_turns_ = wrapped(time_s_ / length_s_);
    }
    amplitude_ = interpolated(settings_.envelope, time_s_);
  }
  value_ = amplitude_ * std::sin(two_pi * phase_turns_);
}

/// To a random position at least `min_movement` away, in a random time.
void Waveform::next_movement() {
  hand_from_ = hand_to_;
  const double below = std::max(0.0, hand_from_ - min_movement);
  const double above = std::max(0.0, 1.0 - min_movement - hand_from_);
  const double target = uniform(random_) * (below + above);
  hand_to_ = target < below ? target : hand_from_ + min_movement + (target - below);
  hand_time_s_ = 0.0;
  hand_duration_s_ = config::shortest_move_s(settings_.by_hand) *
                     (1.0 + (longest_duration - 1.0) * uniform(random_));
}

void Waveform::modulate_by_hand(double duration_s) {
  advance_carrier(carrier_.value(), duration_s);
  hand_time_s_ += duration_s;
  if (hand_time_s_ >= hand_duration_s_) {
    const double excess_s = hand_time_s_ - hand_duration_s_;
    next_movement();
    hand_time_s_ = std::min(excess_s, hand_duration_s_);
  }
  modulation_turns_ = std::min(hand_time_s_ / hand_duration_s_, last_turn);
  const double position = hand_from_ + (hand_to_ - hand_from_) * hand_step(modulation_turns_);
  const double lowest = std::min(settings_.by_hand.lowest, level_.value());
  amplitude_ = lowest + (level_.value() - lowest) * position;
  value_ = amplitude_ * std::sin(two_pi * phase_turns_);
}

void Waveform::sweep(double duration_s) {
  // Midpoint frequency: exact for a linear sweep.
  const double middle = sweep_progress(settings_.sweep, time_s_ + duration_s / 2.0);
  phase_turns_ = wrapped(phase_turns_ + sweep_hz(settings_.sweep, middle) * duration_s);
  time_s_ += duration_s;
  time_s_ = settings_.sweep.at_end == config::SweepEnd::repeat ? std::fmod(time_s_, length_s_)
                                                               : std::min(time_s_, length_s_);
  const double progress = sweep_progress(settings_.sweep, time_s_);
  carrier_hz_ = sweep_hz(settings_.sweep, progress);
  modulation_turns_ = std::min(progress, last_turn);
  amplitude_ = level_.value();
  value_ = amplitude_ * std::sin(two_pi * phase_turns_);
}

void Waveform::burst(double duration_s) {
  const config::Sweep& sweep = settings_.sweep;
  double step_s = duration_s;
  time_s_ += duration_s;
  if (time_s_ >= length_s_) {
    // Identical bursts: each begins at phase 0, after the previous one has faded out.
    time_s_ = std::fmod(time_s_, length_s_);
    phase_turns_ = 0.0;
    step_s = time_s_;
  }
  modulation_turns_ = std::min(time_s_ / length_s_, last_turn);
  const double left_s = sweep.duration_s - time_s_;
  if (left_s <= 0.0) {
    amplitude_ = 0.0;
    value_ = 0.0;
    return;
  }
  const double middle = std::max(0.0, time_s_ - step_s / 2.0) / sweep.duration_s;
  phase_turns_ = wrapped(phase_turns_ + sweep_hz(sweep, middle) * step_s);
  carrier_hz_ = sweep_hz(sweep, time_s_ / sweep.duration_s);
  amplitude_ = level_.value() * smooth_step(std::min(1.0, time_s_ / sweep.taper_s)) *
               smooth_step(std::min(1.0, left_s / sweep.taper_s));
  value_ = amplitude_ * std::sin(two_pi * phase_turns_);
}

void Waveform::sum_lines(double duration_s) {
  double sum = 0.0;
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    const config::Line& line = lines_[i];
    line_turns_[i] = wrapped(line_turns_[i] + line.frequency_hz * duration_s);
    sum += line.amplitude * std::sin(two_pi * (line_turns_[i] + line.phase_deg / 360.0));
  }
  amplitude_ = level_.value() * lines_amplitude_;
  value_ = level_.value() * sum;
}

void Waveform::play(double duration_s) {
  time_s_ += duration_s;
  if (time_s_ >= length_s_) {
    const bool repeats = settings_.file.at_end == config::DriveFileEnd::repeat && length_s_ > 0.0;
    over_ = !repeats;
    time_s_ = repeats ? std::fmod(time_s_, length_s_) : length_s_;
  }
  modulation_turns_ = length_s_ > 0.0 ? std::min(time_s_ / length_s_, last_turn) : 0.0;
  value_ = file_.at(time_s_);
  amplitude_ = std::abs(value_);
}

}  // namespace stickslip::daemon
