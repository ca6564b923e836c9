#include "tools/dynamics/lyapunov.h"

#include <algorithm>
#include <array>
#include <stdexcept>

namespace stickslip::dynamics {

namespace {

using physics::max_rig_states;

// How far each state moves over some periods; 0 for states that take no part.
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

}  // namespace

Lyapunov largest_exponent(const physics::Model& model, const Drive& drive,
                          const LyapunovOptions& options) {
  constexpr int stretches = 20;
  constexpr int renewals = 20;         // per period
  constexpr double distance = 1.0e-8;  // of the spread
  if (options.periods < stretches) {
    throw std::invalid_argument("an exponent needs at least 20 drive periods");
  }
  int steps = options.steps_per_period > 0 ? options.steps_per_period : enough_steps(model, drive);
  steps = (steps + renewals - 1) / renewals * renewals;
  Orbit orbit(model, drive, steps, options.x_m, options.v_m_s);
  orbit.skip(options.transient);
  const auto spread = spread_of(orbit, 20);

  Orbit neighbour = orbit;
  auto apart = orbit.now().state.s;
  for (std::size_t i = 0; i < apart.size(); ++i) apart[i] += distance * spread[i];
  neighbour.set_state(apart);

  std::array<double, stretches> growth{};
  const int periods_each = options.periods / stretches;
  const double parts = static_cast<double>(stretches) * periods_each * renewals;
  double parts_done = 0.0;
  for (double& sum : growth) {
    for (int part = 0; part < periods_each * renewals; ++part) {
      if (options.progress) options.progress(parts_done++ / parts);
      for (int k = 0; k < steps / renewals; ++k) {
        orbit.step();
        neighbour.step();
      }
      double square = 0.0;
      int states = 0;
      for (std::size_t i = 0; i < spread.size(); ++i) {
        if (!(spread[i] > 0.0)) continue;
        const double off = (neighbour.now().state.s[i] - orbit.now().state.s[i]) / spread[i];
        square += off * off;
        ++states;
      }
      // Orbits that have met (both stick at the same place) are parted again: to the smallest
      // distance that numbers can hold apart.
      const double size = std::max(std::sqrt(square / std::max(1, states)), 1.0e-15);
      sum += std::log(size / distance);
      auto brought_back = orbit.now().state.s;
      if (size > 1.0e-15) {
        for (std::size_t i = 0; i < spread.size(); ++i) {
          brought_back[i] += (neighbour.now().state.s[i] - brought_back[i]) * (distance / size);
        }
      } else {
        for (std::size_t i = 0; i < spread.size(); ++i) brought_back[i] += distance * spread[i];
      }
      neighbour.set_state(brought_back);
    }
  }
  const double duration_s = periods_each * drive.period_s();
  double mean = 0.0;
  for (double& sum : growth) mean += sum /= duration_s;
  mean /= stretches;
  double square = 0.0;
  for (const double each : growth) square += (each - mean) * (each - mean);
  Lyapunov out;
  out.exponent_per_s = mean;
  out.standard_error_per_s = std::sqrt(square / (stretches * (stretches - 1.0)));
  out.per_period = mean * drive.period_s();
  return out;
}

}  // namespace stickslip::dynamics
