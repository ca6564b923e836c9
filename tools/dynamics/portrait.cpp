// SPDX-License-Identifier: Apache-2.0
#include "tools/dynamics/portrait.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "tools/dynamics/flow.h"

namespace stickslip::dynamics {

namespace {

Orbit started(const physics::Model& model, const Drive& drive, const PortraitOptions& options) {
  const int steps = options.steps_per_period > 0
                        ? options.steps_per_period
                        : enough_steps(model, drive, options.transient + options.periods);
  Orbit orbit(model, drive, steps, options.x_m, options.v_m_s);
  orbit.skip(options.transient);
  return orbit;
}

void widen(Range& range, double value) {
  range.low = std::min(range.low, value);
  range.high = std::max(range.high, value);
}

Range nothing() {
  return {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
}

std::vector<Point> section_of_flow(const physics::Model& model, const Drive& drive,
                                   const PortraitOptions& options) {
  // The flow chooses its steps itself, of about that number.
  (void)enough_steps(model, drive, options.transient + options.periods);
  constexpr double tolerance = 1.0e-7;
  Flow flow(model, drive, tolerance, options.x_m, options.v_m_s);
  const double phase = options.phase - std::floor(options.phase);
  std::vector<Point> points;
  points.reserve(static_cast<std::size_t>(std::max(0, options.periods)));
  for (int period = 0; period < options.periods; ++period) {
    if (options.progress) options.progress(static_cast<double>(period) / options.periods);
    flow.advance((options.transient + period + phase) * drive.period_s());
    points.push_back(flow.now());
  }
  return points;
}

}  // namespace

std::vector<Point> poincare_section(const physics::Model& model, const Drive& drive,
                                    const PortraitOptions& options) {
  if (options.steps_per_period == 0 && Flow::can_follow(model)) {
    return section_of_flow(model, drive, options);
  }
  Orbit orbit = started(model, drive, options);
  const auto offset = static_cast<long>(
      std::lround((options.phase - std::floor(options.phase)) * orbit.steps_per_period()));
  for (long k = 0; k < offset; ++k) orbit.step();
  std::vector<Point> points;
  points.reserve(static_cast<std::size_t>(std::max(0, options.periods)));
  for (int period = 0; period < options.periods; ++period) {
    if (options.progress) options.progress(static_cast<double>(period) / options.periods);
    points.push_back(orbit.now());
    orbit.skip(1);
  }
  return points;
}

std::vector<Point> trajectory(const physics::Model& model, const Drive& drive,
                              const PortraitOptions& options, int stride) {
  if (stride < 1) throw std::invalid_argument("a stride is at least 1");
  Orbit orbit = started(model, drive, options);
  std::vector<Point> points;
  const long steps = static_cast<long>(options.periods) * orbit.steps_per_period();
  for (long k = 0; k < steps; ++k) {
    if (k % stride == 0) points.push_back(orbit.now());
    orbit.step();
  }
  points.push_back(orbit.now());
  return points;
}

Portrait portrait(const physics::Model& model, const Drive& drive, const PortraitOptions& options) {
  Orbit orbit = started(model, drive, options);
  Portrait out;
  out.displacement_m = out.velocity_m_s = out.normal_load_n = nothing();
  const bool loaded = orbit.rig().structure().loaded;
  const long steps = static_cast<long>(options.periods) * orbit.steps_per_period();
  long lost = 0;
  long negative = 0;
  long stuck = 0;
  double before = orbit.now().v();
  double came_from = 0.0;  // sign of the velocity before the current arrival; 0: none
  double farthest = 0.0;
  double sum = 0.0;
  for (long k = 0; k < steps; ++k) {
    if (options.progress) options.progress(static_cast<double>(k) / static_cast<double>(steps));
    orbit.step();
    const Point& now = orbit.now();
    const double v = now.v();
    widen(out.displacement_m, now.x());
    widen(out.velocity_m_s, v);
    widen(out.normal_load_n, now.state.load);
    if (loaded && now.state.load <= 0.0) ++lost;
    if (now.state.theta * now.state.slip < 0.0) ++negative;
    if (now.state.slip == 0.0) ++stuck;

    const bool would_hold = std::abs(orbit.force_without_friction_n()) < orbit.friction_limit_n();
    if (came_from != 0.0) {
      farthest = std::max(farthest, -came_from * v);
      if (!would_hold || came_from * v > 0.0) {
        sum += farthest;
        ++out.arrivals;
        came_from = 0.0;
      }
    } else if (would_hold && before != 0.0 && before * v <= 0.0) {
      came_from = before > 0.0 ? 1.0 : -1.0;
      farthest = std::max(0.0, -came_from * v);
    }
    before = v;
  }
  const auto share = [steps](long count) {
    return steps > 0 ? static_cast<double>(count) / static_cast<double>(steps) : 0.0;
  };
  out.contact_lost = share(lost);
  out.negative_friction = share(negative);
  out.sticking = share(stuck);
  const double range = out.velocity_m_s.high - out.velocity_m_s.low;
  if (out.arrivals > 0 && range > 0.0) out.overshoot = sum / out.arrivals / range;
  return out;
}

}  // namespace stickslip::dynamics
