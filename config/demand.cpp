// SPDX-License-Identifier: Apache-2.0
#include "config/demand.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>

#include "physics/number_text.h"

namespace stickslip::config {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

/// Demand of A(t) sin(phase(t)) with bounds of A, its derivatives, the angular frequency and its
/// derivative.
Demand of_carrier(double amplitude, double slope, double curvature, double omega,
                  double omega_dot) {
  return {amplitude, std::hypot(amplitude * omega, slope),
          std::hypot(amplitude * omega * omega + curvature,
                     2.0 * slope * omega + amplitude * omega_dot)};
}

Demand of_modulated(const Excitation& excitation) {
  double amplitude = excitation.amplitude;
  double slope = 0.0;
  double curvature = 0.0;
  if (excitation.envelope.empty()) {
    const double omega = two_pi * excitation.modulation_hz;
    slope = amplitude * excitation.modulation_depth / 2.0 * omega;
    curvature = slope * omega;
  } else {
    amplitude = excitation.envelope.front().amplitude;
    for (std::size_t i = 1; i < excitation.envelope.size(); ++i) {
      const EnvelopePoint& a = excitation.envelope[i - 1];
      const EnvelopePoint& b = excitation.envelope[i];
      amplitude = std::max(amplitude, b.amplitude);
      slope = std::max(slope, std::abs(b.amplitude - a.amplitude) / (b.time_s - a.time_s));
    }
  }
  return of_carrier(amplitude, slope, curvature, two_pi * excitation.carrier_hz, 0.0);
}

// The movements of the hand are polynomials with these extremes of their derivatives.
Demand of_hand(const Excitation& excitation) {
  const double span = std::max(0.0, excitation.amplitude - excitation.by_hand.lowest);
  const double shortest_s = shortest_move_s(excitation.by_hand);
  return of_carrier(excitation.amplitude, 1.875 * span / shortest_s,
                    10.0 / std::numbers::sqrt3 * span / (shortest_s * shortest_s),
                    two_pi * excitation.carrier_hz, 0.0);
}

Demand of_sweep(const Excitation& excitation) {
  const Sweep& sweep = excitation.sweep;
  const double highest = std::max(sweep.from_hz, sweep.to_hz);
  const double rate =
      sweep.scale == SweepScale::linear
          ? std::abs(sweep.to_hz - sweep.from_hz) / sweep.duration_s
          : highest * std::abs(std::log(sweep.to_hz / sweep.from_hz)) / sweep.duration_s;
  const bool chirp = excitation.kind == ExcitationKind::chirp;
  const double slope = chirp ? 1.5 * excitation.amplitude / sweep.taper_s : 0.0;
  const double curvature =
      chirp ? 6.0 * excitation.amplitude / (sweep.taper_s * sweep.taper_s) : 0.0;
  return of_carrier(excitation.amplitude, slope, curvature, two_pi * highest, two_pi * rate);
}

/// Bound of |sum of a_n (2 pi f_n)^k exp(i phase_n(t))| over time for lines of equal spacing: the
/// maximum on a grid, and the factor by which the sum can be larger between its points.
double largest_sum(const std::vector<Line>& lines, int derivative) {
  const std::size_t points = 16 * lines.size();
  double largest = 0.0;
  for (std::size_t j = 0; j < points; ++j) {
    std::complex<double> sum = 0.0;
    for (std::size_t n = 0; n < lines.size(); ++n) {
      const double turns = static_cast<double>(n * j % points) / static_cast<double>(points);
      sum += std::polar(lines[n].amplitude * std::pow(two_pi * lines[n].frequency_hz, derivative),
                        two_pi * (turns + lines[n].phase_deg / 360.0));
    }
    largest = std::max(largest, std::abs(sum));
  }
  return largest / std::cos(std::numbers::pi / 32.0);
}

Demand of_multisine(const Excitation& excitation) {
  const std::vector<Line> lines = lines_of(excitation);
  if (excitation.multisine.lines.empty()) {
    return {excitation.amplitude, largest_sum(lines, 1), largest_sum(lines, 2)};
  }
  // Lines of arbitrary frequencies are in phase at some time.
  Demand out;
  for (const Line& line : lines) {
    const double omega = two_pi * line.frequency_hz;
    out.displacement += line.amplitude;
    out.velocity += line.amplitude * omega;
    out.acceleration += line.amplitude * omega * omega;
  }
  return out;
}

}  // namespace

double shortest_move_s(const ByHand& by_hand) { return 1.0 / by_hand.bandwidth_hz; }

std::vector<Line> lines_of(const Excitation& excitation) {
  const Multisine& multisine = excitation.multisine;
  if (!multisine.lines.empty()) return multisine.lines;
  std::vector<Line> lines;
  if (multisine.count < 2) return lines;
  const double spacing = (multisine.to_hz - multisine.from_hz) / (multisine.count - 1);
  for (int n = 0; n < multisine.count; ++n) {
    const double phase_deg = -180.0 * n * (n + 1.0) / multisine.count;
    lines.push_back({multisine.from_hz + spacing * n, 1.0, std::fmod(phase_deg, 360.0)});
  }
  const double scale = excitation.amplitude / largest_sum(lines, 0);
  for (Line& line : lines) line.amplitude = scale;
  return lines;
}

Demand demand_of(const Excitation& excitation) {
  switch (excitation.kind) {
    case ExcitationKind::modulated:
      return of_modulated(excitation);
    case ExcitationKind::by_hand:
      return of_hand(excitation);
    case ExcitationKind::sweep:
    case ExcitationKind::chirp:
      return of_sweep(excitation);
    case ExcitationKind::multisine:
      return of_multisine(excitation);
    case ExcitationKind::file:
      break;
  }
  return {};
}

double highest_frequency_hz(const Excitation& excitation) {
  double highest = 0.0;
  switch (excitation.kind) {
    case ExcitationKind::modulated:
    case ExcitationKind::by_hand:
      return excitation.carrier_hz;
    case ExcitationKind::sweep:
    case ExcitationKind::chirp:
      return std::max(excitation.sweep.from_hz, excitation.sweep.to_hz);
    case ExcitationKind::multisine:
      for (const Line& line : lines_of(excitation)) highest = std::max(highest, line.frequency_hz);
      return highest;
    case ExcitationKind::file:
      break;
  }
  return highest;
}

std::optional<Excess> excess_of(const Demand& demand, const Limits& limits, bool force) {
  constexpr double rounding = 1.0 + 1e-9;
  const std::array<Excess, 3> of_base = {
      {{"limits.displacement_m", limits.displacement_m, demand.displacement, "m"},
       {"limits.velocity_m_s", limits.velocity_m_s, demand.velocity, "m/s"},
       {"limits.acceleration_m_s2", limits.acceleration_m_s2, demand.acceleration, "m/s^2"}}};
  const std::array<Excess, 2> of_force = {
      {{"limits.force_n", limits.force_n, demand.displacement, "N"},
       {"limits.force_slew_n_s", limits.force_slew_n_s, demand.velocity, "N/s"}}};
  std::optional<Excess> worst;
  const auto compare = [&worst](const Excess& each) {
    if (!(each.demand <= each.limit * rounding) &&
        (!worst || each.demand / each.limit > worst->demand / worst->limit)) {
      worst = each;
    }
  };
  if (force) {
    for (const Excess& each : of_force) compare(each);
  } else {
    for (const Excess& each : of_base) compare(each);
  }
  return worst;
}

std::string short_number(double value) { return physics::number_text(value, 4); }

std::string text_of(const Excess& excess) {
  return short_number(excess.demand) + " " + excess.unit + ", " + excess.key + " allows " +
         short_number(excess.limit);
}

}  // namespace stickslip::config
