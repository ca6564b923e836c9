// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/noiseless_run.h"

#include <algorithm>
#include <cmath>

namespace stickslip::concealment {

namespace {

using Readings = std::array<double, channel_count>;

constexpr double warm_up_s = 8.0;
constexpr double window_s = 0.4;
constexpr std::size_t windows = 20;

// Between two steps of the simulator the readings are interpolated: they belong to the very time.
Readings readings_at(ReferenceSimulator& simulator, double time_s) {
  const double steps = time_s / reference_step_s;
  const double before = std::floor(steps);
  simulator.advance(before * reference_step_s);
  const double part = steps - before;
  constexpr double negligible = 1.0e-3;
  if (part < negligible || part > 1.0 - negligible) {
    simulator.advance(time_s);
    return simulator.read();
  }
  Readings readings = simulator.read();
  simulator.advance((before + 1.0) * reference_step_s);
  const Readings after = simulator.read();
  for (std::size_t c = 0; c < channel_count; ++c) readings[c] += part * (after[c] - readings[c]);
  return readings;
}

}  // namespace

NoiselessRun simulate(const ReferenceRig& rig, std::span<const double> times_s, bool with_windows) {
  NoiselessRun run;
  ReferenceSimulator simulator(rig, warm_up_s);
  const std::size_t apart = std::max<std::size_t>(1, times_s.size() / (windows + 1));
  for (std::size_t k = 0; k < times_s.size(); ++k) {
    const Readings readings = readings_at(simulator, times_s[k]);
    if (with_windows && k % apart == apart / 2 && run.window_starts.size() < windows) {
      run.window_starts.push_back(simulator);
    }
    run.readings.push_back(readings);
    run.truth.push_back(simulator.truth());
  }
  run.slip_share = simulator.slip_share();
  return run;
}

bool is_plausible(const NoiselessRun& run, const ReferenceRig& rig) {
  for (const Readings& each : run.readings) {
    for (const double value : each) {
      if (!std::isfinite(value)) return false;
    }
    if (std::abs(each[index_of(Channel::displacement)]) > 0.06) return false;
  }
  return !rig.friction || rig.excitation == physics::Excitation::imposed || run.slip_share > 0.1;
}

void measure(const NoiselessRun& run, Sizes& sizes) {
  const auto n = static_cast<double>(run.readings.size());
  for (std::size_t c = 0; c < channel_count; ++c) {
    double sum = 0.0;
    double square = 0.0;
    double largest = 0.0;
    for (const Readings& each : run.readings) {
      sum += each[c];
      square += each[c] * each[c];
      largest = std::max(largest, std::abs(each[c]));
    }
    sizes.spread[c] = std::sqrt(std::max(0.0, square / n - sum / n * (sum / n)));
    sizes.largest[c] = largest;
  }
  sizes.displacement_m = sizes.largest[index_of(Channel::displacement)];
  // The simulator differentiates the displacement even if no velocity is recorded.
  sizes.velocity_m_s = sizes.largest[index_of(Channel::velocity)];
}

Eigen::VectorXd difference(const NoiselessRun& run, const ReferenceRig& rig,
                           const ReferenceRig& other, double sample_rate_hz) {
  std::vector<double> all;
  const auto samples = static_cast<int>(window_s * sample_rate_hz);
  for (const ReferenceSimulator& start : run.window_starts) {
    ReferenceSimulator unchanged = start;
    ReferenceSimulator changed = start;
    changed.replace(other);
    for (int k = 1; k <= samples; ++k) {
      const double time_s = start.time_s() + k / sample_rate_hz;
      unchanged.advance(time_s);
      changed.advance(time_s);
      const Readings a = unchanged.read();
      const Readings b = changed.read();
      for (std::size_t c = 0; c < channel_count; ++c) {
        if (!rig.instrument[c].recorded) continue;
        all.push_back((b[c] - a[c]) / rig.instrument[c].noise_std);
      }
    }
  }
  return Eigen::Map<const Eigen::VectorXd>(all.data(), static_cast<Eigen::Index>(all.size()));
}

double root_mean_square(const Eigen::VectorXd& values) {
  return values.size() == 0 ? 0.0
                            : std::sqrt(values.squaredNorm() / static_cast<double>(values.size()));
}

}  // namespace stickslip::concealment
