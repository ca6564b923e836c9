// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/drive_phase.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "diagnosis/median.h"
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

WindowDrive drive_in(const DrivePhase& drive, const Window& window, double period_s) {
  using std::numbers::pi;
  WindowDrive out;
  double turned = 0.0;
  for (std::size_t k = window.begin; k < window.end; ++k) {
    out.amplitude += drive.amplitude[k] / static_cast<double>(window.end - window.begin);
    if (k == window.begin) continue;
    turned += std::remainder(drive.phase_rad[k] - drive.phase_rad[k - 1], 2.0 * pi);
  }
  const auto steps = static_cast<double>(window.end - window.begin - 1);
  out.frequency_hz = std::abs(turned) / (2.0 * pi * steps * period_s);
  return out;
}

bool is_periodic(const DrivePhase& drive, const Experiment& e) {
  constexpr double steady = 0.35;
  std::vector<double> hz;
  double turns = 0.0;
  double amplitude = 0.0;
  for (const Window& window : e.windows) {
    const WindowDrive each = drive_in(drive, window, e.period_s);
    hz.push_back(each.frequency_hz);
    turns += each.frequency_hz * e.period_s * static_cast<double>(window.end - window.begin);
    amplitude = std::max(amplitude, each.amplitude);
  }
  if (!(amplitude > 0.0 && turns >= 1.5)) return false;
  double change = 0.0;
  for (std::size_t i = 1; i < hz.size(); ++i) change += std::abs(hz[i] - hz[i - 1]);
  return change <= steady * median(hz) * static_cast<double>(hz.size() - 1);
}

}  // namespace stickslip::diagnosis
