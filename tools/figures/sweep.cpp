// SPDX-License-Identifier: Apache-2.0
#include "tools/figures/sweep.h"

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "physics/simulator.h"

namespace stickslip::figures {

namespace {

// b and b'' of A(t) sin(w t), A(t) = a (1 - d (1 - cos(q t)) / 2) r(t), with a smooth ramp r of
// half a second.
physics::Input base_at(const Sweep& sweep, double t) {
  constexpr double ramp_s = 0.5;
  const double w = 2.0 * std::numbers::pi * sweep.frequency_hz;
  const double q = 2.0 * std::numbers::pi * sweep.modulation_hz;
  const double d = sweep.modulation_hz > 0.0 ? sweep.modulation_depth : 0.0;
  const auto displacement = [&](double s) {
    const double u = std::min(1.0, std::max(0.0, s / ramp_s));
    const double ramp = u * u * u * (10.0 + u * (6.0 * u - 15.0));
    return sweep.amplitude_m * (1.0 - 0.5 * d * (1.0 - std::cos(q * s))) * ramp * std::sin(w * s);
  };
  // Fourth-order difference: at this step its error and its rounding are both below 1e-6 of b''.
  constexpr double h = 1.0e-3;
  physics::Input input;
  input.base_displacement_m = displacement(t);
  input.base_acceleration_m_s2 =
      (-displacement(t + 2 * h) + 16.0 * displacement(t + h) - 30.0 * displacement(t) +
       16.0 * displacement(t - h) - displacement(t - 2 * h)) /
      (12.0 * h * h);
  return input;
}

}  // namespace

protocol::Recording record(const physics::Model& model, const Sweep& sweep) {
  if (model.oscillator.excitation != physics::Excitation::base) {
    throw std::invalid_argument("a sweep needs a base-excited model");
  }
  physics::SimulationOptions options;
  options.seed = sweep.seed;
  options.noise = sweep.noise;
  physics::RigSimulator rig(model, options);
  rig.set_input(base_at(sweep, 0.0));
  const double step_s = 1.0 / sweep.rate_hz;
  const auto transient = std::llround(sweep.transient_s * sweep.rate_hz);
  const auto samples = std::llround(sweep.duration_s * sweep.rate_hz);
  protocol::Recording out;
  out.source = "simulated";
  // Interpolated linearly over at most a millisecond, since the drive is curved between samples.
  const auto pieces = std::max(1LL, std::llround(step_s / 1.0e-3));
  for (long long k = 0; k <= transient + samples; ++k) {
    if (k >= transient) {
      Frame frame = rig.read();
      frame.time_ns = std::llround(static_cast<double>(k - transient) * step_s * 1.0e9);
      out.channels |= frame.valid;
      out.frames.push_back(frame);
    }
    for (long long piece = 1; piece <= pieces; ++piece) {
      const double t =
          (static_cast<double>(k) + static_cast<double>(piece) / static_cast<double>(pieces)) *
          step_s;
      rig.advance(step_s / static_cast<double>(pieces), base_at(sweep, t));
    }
  }
  return out;
}

}  // namespace stickslip::figures
