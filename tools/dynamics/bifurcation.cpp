#include "tools/dynamics/bifurcation.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numbers>
#include <stdexcept>

#include "diagnosis/parallel/for_each.h"
#include "physics/model_consistency.h"
#include "tools/dynamics/lyapunov.h"

namespace stickslip::dynamics {

namespace {

constexpr const char* drive_acceleration = "drive.acceleration_m_s2";
constexpr const char* drive_amplitude = "drive.amplitude_m";
constexpr const char* drive_frequency = "drive.frequency_hz";

void set(physics::Model& model, const std::string& path, double value) {
  for (const auto& named : physics::parameters_of(model)) {
    if (named.path == path) named.parameter->value = value;
  }
}

}  // namespace

std::vector<std::string> bifurcation_paths(const physics::Model& model) {
  std::vector<std::string> paths = {drive_acceleration, drive_frequency};
  if (model.oscillator.excitation == physics::Excitation::base) paths.push_back(drive_amplitude);
  physics::Model copy = model;
  for (const auto& named : physics::parameters_of(copy)) paths.push_back(named.path);
  return paths;
}

std::string refusal(const physics::Model& model, const std::string& path, double value) {
  if (!std::isfinite(value)) return "must be finite";
  if (path == drive_frequency) return value > 0.0 ? "" : "must be above 0";
  if (path == drive_acceleration || path == drive_amplitude) {
    return value >= 0.0 ? "" : "must be 0 or more";
  }
  physics::Model here = model;
  set(here, path, value);
  const auto problems = physics::inconsistencies_of(here);
  return problems.empty() ? "" : problems.front().message;
}

std::vector<BifurcationColumn> bifurcation(const physics::Model& model, const Drive& drive,
                                           const std::string& path,
                                           const std::vector<double>& values,
                                           const BifurcationOptions& options) {
  const auto paths = bifurcation_paths(model);
  if (std::find(paths.begin(), paths.end(), path) == paths.end()) {
    throw std::invalid_argument("the model has no parameter \"" + path + "\"");
  }
  for (const double value : values) {
    std::string why = refusal(model, path, value);
    if (!why.empty()) throw std::invalid_argument(why.insert(0, path + " "));
  }
  std::vector<BifurcationColumn> columns(values.size());
  std::mutex progress_mutex;
  std::size_t done = 0;
  parallel::for_each(values.size(), options.threads, [&](std::size_t i) {
    physics::Model here = model;
    Drive drive_here = drive;
    if (path == drive_acceleration) {
      drive_here.acceleration_m_s2 = values[i];
    } else if (path == drive_amplitude) {
      drive_here.acceleration_m_s2 = values[i] * drive.omega_rad_s * drive.omega_rad_s;
    } else if (path == drive_frequency) {
      drive_here.omega_rad_s = 2.0 * std::numbers::pi * values[i];
      if (options.base_amplitude_m) {
        drive_here.acceleration_m_s2 =
            *options.base_amplitude_m * drive_here.omega_rad_s * drive_here.omega_rad_s;
      }
    } else {
      set(here, path, values[i]);
    }
    columns[i].value = values[i];
    columns[i].section = poincare_section(here, drive_here, options.portrait);
    if (options.with_exponents) {
      LyapunovOptions lyapunov;
      lyapunov.transient = options.portrait.transient;
      lyapunov.periods = std::max(20, options.portrait.periods);
      lyapunov.steps_per_period = options.portrait.steps_per_period;
      columns[i].exponent_per_s = largest_exponent(here, drive_here, lyapunov).exponent_per_s;
    }
    if (options.progress) {
      const std::lock_guard lock(progress_mutex);
      options.progress(++done, values.size());
    }
  });
  return columns;
}

}  // namespace stickslip::dynamics
