#include "tools/dynamics/bifurcation.h"

#include <algorithm>
#include <mutex>
#include <stdexcept>

#include "tools/dynamics/lyapunov.h"
#include "tools/parallel/for_each.h"

namespace stickslip::dynamics {

namespace {

constexpr const char* drive_amplitude = "drive.amplitude";
constexpr const char* drive_frequency = "drive.frequency_hz";

}  // namespace

std::vector<std::string> bifurcation_paths(const physics::Model& model) {
  std::vector<std::string> paths = {drive_amplitude, drive_frequency};
  physics::Model copy = model;
  for (const auto& named : physics::parameters_of(copy)) paths.push_back(named.path);
  return paths;
}

std::vector<BifurcationColumn> bifurcation(const physics::Model& model, const Drive& drive,
                                           const std::string& path,
                                           const std::vector<double>& values,
                                           const BifurcationOptions& options) {
  const auto paths = bifurcation_paths(model);
  if (std::find(paths.begin(), paths.end(), path) == paths.end()) {
    throw std::invalid_argument("the model has no parameter \"" + path + "\"");
  }
  std::vector<BifurcationColumn> columns(values.size());
  std::mutex progress_mutex;
  std::size_t done = 0;
  parallel::for_each(values.size(), options.threads, [&](std::size_t i) {
    physics::Model here = model;
    Drive drive_here = drive;
    if (path == drive_amplitude) {
      drive_here.acceleration_m_s2 = values[i];
    } else if (path == drive_frequency) {
      drive_here.omega_rad_s = 2.0 * std::numbers::pi * values[i];
    } else {
      for (const auto& named : physics::parameters_of(here)) {
        if (named.path == path) named.parameter->value = values[i];
      }
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
