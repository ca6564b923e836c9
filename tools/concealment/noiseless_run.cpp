#include "tools/concealment/noiseless_run.h"

#include <algorithm>
#include <cmath>

namespace stickslip::concealment {

namespace {

using Readings = std::array<double, channel_count>;

constexpr double warm_up_s = 8.0;
constexpr double window_s = 0.4;
constexpr std::size_t windows = 20;

}  // namespace

NoiselessRun simulate(const ReferenceRig& rig, double sample_rate_hz, double duration_s,
                      bool with_windows) {
  NoiselessRun run;
  ReferenceSimulator simulator(rig, warm_up_s);
  const auto count = static_cast<std::size_t>(std::llround(duration_s * sample_rate_hz));
  const std::size_t apart = std::max<std::size_t>(1, count / (windows + 1));
  for (std::size_t k = 0; k < count; ++k) {
    simulator.advance(static_cast<double>(k) / sample_rate_hz);
    if (with_windows && k % apart == apart / 2 && run.window_starts.size() < windows) {
      run.window_starts.push_back(simulator);
    }
    run.readings.push_back(simulator.read());
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
