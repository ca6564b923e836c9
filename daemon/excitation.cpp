#include "daemon/excitation.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

namespace stickslip::daemon {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

double wrapped(double turns) { return turns - std::floor(turns); }

/// Zero slope at both ends, so that a ramp does not kick the shaker's velocity.
double smooth_step(double u) { return u * u * (3.0 - 2.0 * u); }

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

}  // namespace

Excitation::Excitation(const config::Excitation& settings)
    : settings_(settings),
      envelope_length_s_(settings.envelope.empty() ? 0.0 : settings.envelope.back().time_s) {}

void Excitation::start() {
  if (!settings_.enabled || state_ == State::steady) return;
  state_ = State::rising;
}

void Excitation::stop() {
  if (state_ != State::off) state_ = State::falling;
}

void Excitation::cut() {
  state_ = State::off;
  ramp_ = 0.0;
  now_.value = 0.0;
  now_.amplitude = 0.0;
}

double Excitation::unramped_amplitude() const {
  if (!settings_.envelope.empty()) return interpolated(settings_.envelope, envelope_time_s_);
  const double depth = settings_.modulation_depth;
  return settings_.amplitude *
         (1.0 - depth / 2.0 + depth / 2.0 * std::cos(two_pi * now_.modulation_turns));
}

Drive Excitation::advance(double duration_s) {
  now_.carrier_hz = settings_.carrier_hz;
  if (state_ == State::off) return now_;

  now_.phase_turns = wrapped(now_.phase_turns + settings_.carrier_hz * duration_s);
  if (settings_.envelope.empty()) {
    now_.modulation_turns = wrapped(now_.modulation_turns + settings_.modulation_hz * duration_s);
  } else if (envelope_length_s_ > 0.0) {
    envelope_time_s_ += duration_s;
    envelope_time_s_ = settings_.repeat ? std::fmod(envelope_time_s_, envelope_length_s_)
                                        : std::min(envelope_time_s_, envelope_length_s_);
    now_.modulation_turns = wrapped(envelope_time_s_ / envelope_length_s_);
  }

  const double step = settings_.ramp_s > 0.0 ? duration_s / settings_.ramp_s : 1.0;
  if (state_ == State::rising) {
    ramp_ = std::min(1.0, ramp_ + step);
    if (ramp_ >= 1.0) state_ = State::steady;
  } else if (state_ == State::falling) {
    ramp_ = std::max(0.0, ramp_ - step);
    if (ramp_ <= 0.0) {
      cut();
      return now_;
    }
  }

  now_.amplitude = smooth_step(ramp_) * unramped_amplitude();
  now_.value = now_.amplitude * std::sin(two_pi * now_.phase_turns);
  return now_;
}

}  // namespace stickslip::daemon
