// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/drive_phase.h"

#include <cmath>
#include <numbers>

#include "diagnosis/spectrum.h"

namespace stickslip::diagnosis {

namespace {

// The one of these quantities that drives the rig; the others are 0.
double driving_quantity(const Experiment& e, std::size_t sample) {
  const physics::Input& input = e.input[sample * static_cast<std::size_t>(e.substeps)];
  return input.base_displacement_m + input.drive_force_n + input.displacement_m;
}

double mean_of(const std::vector<double>& values) {
  double mean = 0.0;
  for (const double each : values) mean += each / static_cast<double>(values.size());
  return mean;
}

}  // namespace

double drive_frequency_hz(const Experiment& e) {
  const Segment segment = e.longest_segment();
  std::vector<double> value;
  for (std::size_t k = segment.begin; k < segment.end; ++k) {
    value.push_back(driving_quantity(e, k));
  }
  const double mean = mean_of(value);
  for (double& each : value) each -= mean;
  return strongest_frequency_hz(value, e.period_s);
}

DrivePhase drive_phase_of(const Experiment& e) {
  using std::numbers::pi;
  std::vector<double> value(e.samples);
  for (std::size_t k = 0; k < e.samples; ++k) value[k] = driving_quantity(e, k);
  const double mean = mean_of(value);
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
