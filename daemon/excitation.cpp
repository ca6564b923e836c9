// SPDX-License-Identifier: Apache-2.0
#include "daemon/excitation.h"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "config/demand.h"
#include "physics/problem.h"

namespace stickslip::daemon {
namespace {

/// Time in which the amplitude passes through its whole range, unless configured.
constexpr double default_slew_s = 2.0;

/// Zero slope at both ends, so that a ramp does not step the shaker's velocity.
double smooth_step(double u) { return u * u * (3.0 - 2.0 * u); }

DriveFile within_limits(DriveFile file, const DrivenRig& rig, const std::string& name) {
  const bool force = rig.channel == Channel::drive_force;
  const config::Limits limits{rig.limits.displacement, rig.limits.velocity, rig.limits.acceleration,
                              rig.limits.displacement, rig.limits.velocity};
  if (const auto excess = config::excess_of(file.demand(rig.period_s), limits, force)) {
    throw InputError(Problem{name, 0, 0, "requires " + config::text_of(*excess)});
  }
  return file;
}

DriveFile file_of(const config::Excitation& settings, const DrivenRig& rig) {
  if (settings.kind != config::ExcitationKind::file) return {};
  return within_limits(DriveFile::load(settings.file, rig.channel), rig,
                       settings.file.path.string());
}

double amplitude_slew(const config::Excitation& settings, const DrivenRig& rig) {
  // Finite even without limits.
  return settings.amplitude_slew.value_or(std::min(rig.limits.displacement, 1e6) / default_slew_s);
}

}  // namespace

DrivenRig driven_rig(const config::Rig& rig) {
  DrivenRig out;
  out.period_s = 1.0 / rig.loop.rate_hz;
  const config::Limits& limits = rig.limits;
  if (rig.model.oscillator.excitation == physics::Excitation::force) {
    out.channel = Channel::drive_force;
    out.limits = {limits.force_n, limits.force_slew_n_s, std::numeric_limits<double>::infinity()};
  } else {
    out.limits = {limits.displacement_m, limits.velocity_m_s, limits.acceleration_m_s2};
  }
  return out;
}

Excitation::Excitation(const config::Excitation& settings, const DrivenRig& rig)
    : Excitation(settings, rig, Unchecked{}, file_of(settings, rig)) {}

Excitation::Excitation(const config::Excitation& settings, const DrivenRig& rig, DriveFile file,
                       const std::string& name)
    : Excitation(settings, rig, Unchecked{}, within_limits(std::move(file), rig, name)) {}

Excitation::Excitation(const config::Excitation& settings, const DrivenRig& rig, Unchecked,
                       DriveFile file)
    : enabled_(settings.enabled),
      ramp_s_(settings.ramp_s),
      channel_(rig.channel),
      waveform_(settings, amplitude_slew(settings, rig), std::move(file)),
      limits_(rig.limits, rig.period_s) {
  if (settings.control.enabled) control_.emplace(settings.control, rig.period_s);
}

void Excitation::start() {
  if (!enabled_ || state_ == State::steady) return;
  if (state_ == State::off) waveform_.restart();
  state_ = State::rising;
}

void Excitation::stop() {
  if (state_ != State::off) state_ = State::falling;
}

void Excitation::cut() {
  limits_.reset();
  rest();
}

void Excitation::rest() {
  state_ = State::off;
  ramp_ = 0.0;
  now_.value = 0.0;
  now_.amplitude = 0.0;
  now_.limited = Limit::none;
}

void Excitation::observe(const Frame& frame, bool amplifier_on) {
  if (!control_) return;
  Hold reason = Hold::none;
  if (!amplifier_on || is_off()) {
    reason = Hold::amplifier_off;
  } else if (state_ != State::steady) {
    reason = Hold::ramping;
  } else if (now_.limited != Limit::none) {
    reason = Hold::limited;
  }
  control_->update(frame[channel_], frame.has(channel_), now_, reason);
}

/// Applied fraction of the waveform, after one step of the ramp.
double Excitation::ramp_step(double duration_s) {
  const double step = ramp_s_ > 0.0 ? duration_s / ramp_s_ : 1.0;
  if (state_ == State::rising) {
    ramp_ = std::min(1.0, ramp_ + step);
    if (ramp_ >= 1.0) state_ = State::steady;
  } else if (state_ == State::falling) {
    ramp_ = std::max(0.0, ramp_ - step);
  }
  return smooth_step(ramp_);
}

Drive Excitation::advance(double duration_s) {
  if (duration_s <= 0.0) return now_;
  if (state_ == State::off) {
    // The limits keep their history: a start in the next cycle continues from it.
    limits_.next(0.0);
    now_.carrier_hz = waveform_.idle_carrier_hz();
    return now_;
  }
  waveform_.advance(duration_s);
  if (waveform_.over()) stop();
  const double fraction = ramp_step(duration_s);
  const double gain = control_ ? control_->gain() : 1.0;
  now_.gain = gain;
  now_.carrier_hz = waveform_.carrier_hz();
  now_.phase_turns = waveform_.phase_turns();
  now_.modulation_turns = waveform_.modulation_turns();
  now_.amplitude = fraction * waveform_.amplitude();
  now_.value = limits_.next(gain * (fraction * waveform_.value()));
  now_.limited = limits_.limited();
  if (state_ == State::falling && ramp_ <= 0.0 && limits_.is_at_zero()) rest();
  return now_;
}

}  // namespace stickslip::daemon
