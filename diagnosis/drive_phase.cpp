// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/drive_phase.h"

#include <cmath>
#include <numbers>

namespace stickslip::diagnosis {

DrivePhase drive_phase_of(const Experiment& e) {
  using std::numbers::pi;
  std::vector<double> value(e.samples);
  for (std::size_t k = 0; k < e.samples; ++k) {
    const physics::Input& input = e.input[k * static_cast<std::size_t>(e.substeps)];
    value[k] = input.base_displacement_m + input.drive_force_n + input.displacement_m;
  }
  double mean = 0.0;
  for (const double each : value) mean += each / static_cast<double>(e.samples);
  std::vector<double> rate(e.samples);
  double square = 0.0;
  double rate_square = 0.0;
  for (std::size_t k = 0; k < e.samples; ++k) {
    value[k] -= mean;
    if (k > 0 && k + 1 < e.samples) rate[k] = value[k + 1] + mean - value[k - 1];
    square += value[k] * value[k];
    rate_square += rate[k] * rate[k];
  }
  const double scale = rate_square > 0.0 ? std::sqrt(square / rate_square) : 0.0;
  DrivePhase out;
  for (std::size_t k = 0; k < e.samples; ++k) {
    double phase = std::atan2(-scale * rate[k], value[k]);
    if (phase < 0.0) phase += 2.0 * pi;
    out.phase_rad.push_back(phase);
    out.amplitude.push_back(std::hypot(value[k], scale * rate[k]));
  }
  return out;
}

}  // namespace stickslip::diagnosis
