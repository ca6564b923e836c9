// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulated/shaker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace stickslip::drivers {

namespace {

constexpr double suspension_rad_s = 2.0 * std::numbers::pi * 3.0;
/// Limit for steps in the command; no table coasts faster.
constexpr double fastest_coast_m_s = 0.3;

}  // namespace

Shaker::Shaker(physics::Excitation excitation, double bandwidth_hz, double period_s, int steps)
    : excitation_(excitation),
      period_s_(period_s),
      steps_(steps),
      filter_(
          std::array{physics::Filter{physics::FilterKind::butterworth_lowpass, 4, {bandwidth_hz}}},
          period_s / steps) {}

void Shaker::command(double drive, bool amplifier_on) {
  amplifier_on_ = amplifier_on && std::isfinite(drive);
  drive_ = amplifier_on_ ? drive : 0.0;
}

void Shaker::begin_cycle() {
  from_ = to_;
  step_ = 0;
  if (amplifier_on_ || excitation_ == physics::Excitation::force) {
    to_ = drive_;
    rate_ = (to_ - from_) / period_s_;
  } else {
    release();
  }
}

void Shaker::release() {
  const double rate = std::clamp(rate_, -fastest_coast_m_s, fastest_coast_m_s);
  const double pull = rate + suspension_rad_s * from_;
  const double decay = std::exp(-suspension_rad_s * period_s_);
  to_ = (from_ + pull * period_s_) * decay;
  rate_ = (rate - suspension_rad_s * pull * period_s_) * decay;
}

void Shaker::advance() {
  ++step_;
  const double done = static_cast<double>(step_) / steps_;
  filter_.advance(memory_, from_ + (to_ - from_) * done, 0.0);
}

}  // namespace stickslip::drivers
