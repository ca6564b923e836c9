// SPDX-License-Identifier: Apache-2.0
#include "tools/dynamics/lyapunov.h"

#include <algorithm>
#include <array>
#include <stdexcept>

namespace stickslip::dynamics {

namespace {

using physics::max_rig_states;

// Range of each state over some periods; 0 for states that the rig does not have.
std::array<double, max_rig_states> spread_of(Orbit orbit, int periods) {
  std::array<double, max_rig_states> low{};
  std::array<double, max_rig_states> high{};
  low.fill(1.0e300);
  high.fill(-1.0e300);
  for (long k = 0; k < static_cast<long>(periods) * orbit.steps_per_period(); ++k) {
    orbit.step();
    for (std::size_t i = 0; i < low.size(); ++i) {
      low[i] = std::min(low[i], orbit.now().state.s[i]);
      high[i] = std::max(high[i], orbit.now().state.s[i]);
    }
  }
  std::array<double, max_rig_states> spread{};
  for (std::size_t i = 0; i < spread.size(); ++i) {
    if (orbit.rig().has_state(static_cast<int>(i))) spread[i] = high[i] - low[i];
  }
  return spread;
}

constexpr int stretches = 20;
constexpr int renormalisations = 20;  // per period
constexpr double distance = 1.0e-8;   // of the spread
constexpr double min_distance = 1.0e-15;

using States = std::array<double, max_rig_states>;

// Root mean square distance of the orbits, in units of the spread.
double separation(const Orbit& orbit, const Orbit& neighbour, const States& spread) {
  double square = 0.0;
  int states = 0;
  for (std::size_t i = 0; i < spread.size(); ++i) {
    if (!(spread[i] > 0.0)) continue;
    const double off = (neighbour.now().state.s[i] - orbit.now().state.s[i]) / spread[i];
    square += off * off;
    ++states;
  }
  // Orbits that have met (both stick at the same place) are separated again, by the smallest
  // distance that floating point can represent.
  return std::max(std::sqrt(square / std::max(1, states)), min_distance);
}

// Brings the neighbour back to the initial distance, in its current direction.
void renormalise(const Orbit& orbit, Orbit& neighbour, const States& spread, double size) {
  States s = orbit.now().state.s;
  if (size > min_distance) {
    for (std::size_t i = 0; i < spread.size(); ++i) {
      s[i] += (neighbour.now().state.s[i] - s[i]) * (distance / size);
    }
  } else {
    for (std::size_t i = 0; i < spread.size(); ++i) s[i] += distance * spread[i];
  }
  neighbour.set_state(s);
}

Lyapunov summary_of(std::array<double, stretches> growth, double stretch_s, double period_s) {
  double mean = 0.0;
  for (double& sum : growth) mean += sum /= stretch_s;
  mean /= stretches;
  double square = 0.0;
  for (const double each : growth) square += (each - mean) * (each - mean);
  Lyapunov out;
  out.exponent_per_s = mean;
  out.standard_error_per_s = std::sqrt(square / (stretches * (stretches - 1.0)));
  out.per_period = mean * period_s;
  return out;
}

}  // namespace

Lyapunov largest_exponent(const physics::Model& model, const Drive& drive,
                          const LyapunovOptions& options) {
  if (options.periods < stretches) {
    throw std::invalid_argument("an exponent needs at least 20 drive periods");
  }
  int steps = options.steps_per_period > 0
                  ? options.steps_per_period
                  : enough_steps(model, drive, options.transient + options.periods);
  steps = (steps + renormalisations - 1) / renormalisations * renormalisations;
  Orbit orbit(model, drive, steps, options.x_m, options.v_m_s);
  orbit.skip(options.transient);
  const States spread = spread_of(orbit, 20);
  Orbit neighbour = orbit;
  renormalise(orbit, neighbour, spread, 0.0);

  std::array<double, stretches> growth{};
  const int periods_each = options.periods / stretches;
  const double parts = static_cast<double>(stretches) * periods_each * renormalisations;
  double parts_done = 0.0;
  for (double& sum : growth) {
    for (int part = 0; part < periods_each * renormalisations; ++part) {
      if (options.progress) options.progress(parts_done++ / parts);
      for (int k = 0; k < steps / renormalisations; ++k) {
        orbit.step();
        neighbour.step();
      }
      const double size = separation(orbit, neighbour, spread);
      sum += std::log(size / distance);
      renormalise(orbit, neighbour, spread, size);
    }
  }
  return summary_of(growth, periods_each * drive.period_s(), drive.period_s());
}

}  // namespace stickslip::dynamics
