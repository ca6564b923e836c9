// SPDX-License-Identifier: Apache-2.0
#include "tools/dynamics/bifurcation.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numbers>
#include <stdexcept>

#include "diagnosis/parallel/for_each.h"
#include "physics/integration_cost.h"
#include "physics/model_consistency.h"
#include "physics/number_text.h"
#include "physics/problem.h"
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

struct Column {
  physics::Model model;
  Drive drive;
};

Column at_value(const physics::Model& model, const Drive& drive, const std::string& path,
                double value, const BifurcationOptions& options) {
  Column out{model, drive};
  if (path == drive_acceleration) {
    out.drive.acceleration_m_s2 = value;
  } else if (path == drive_amplitude) {
    out.drive.acceleration_m_s2 = value * drive.omega_rad_s * drive.omega_rad_s;
  } else if (path == drive_frequency) {
    out.drive.omega_rad_s = 2.0 * std::numbers::pi * value;
    if (options.base_amplitude_m) {
      out.drive.acceleration_m_s2 =
          *options.base_amplitude_m * out.drive.omega_rad_s * out.drive.omega_rad_s;
    }
  } else {
    set(out.model, path, value);
  }
  return out;
}

/// Throws InputError if all values together take too many steps.
void check_steps(const physics::Model& model, const Drive& drive, const std::string& path,
                 const std::vector<double>& values, const BifurcationOptions& options) {
  if (options.portrait.steps_per_period > 0) return;
  const int periods = options.portrait.transient + options.portrait.periods;
  double sum = 0.0;
  for (const double value : values) {
    const Column column = at_value(model, drive, path, value, options);
    sum += static_cast<double>(periods) * enough_steps(column.model, column.drive, periods);
    const std::string wrong = physics::wrong_with_steps(
        column.model, sum, "the values of " + path + " up to " + physics::number_text(value),
        most_steps_of(static_cast<double>(periods) * static_cast<double>(values.size())));
    if (!wrong.empty()) throw InputError(Problem{"", 0, 0, wrong + " Otherwise take fewer values"});
  }
}

}  // namespace

std::vector<std::string> bifurcation_paths(const physics::Model& model) {
  std::vector<std::string> paths = {drive_acceleration, drive_frequency};
  if (model.oscillator.excitation == physics::Excitation::base) paths.emplace_back(drive_amplitude);
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
  check_steps(model, drive, path, values, options);
  std::vector<BifurcationColumn> columns(values.size());
  std::mutex progress_mutex;
  std::size_t done = 0;
  parallel::for_each(values.size(), options.threads, [&](std::size_t i) {
    const auto [here, drive_here] = at_value(model, drive, path, values[i], options);
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
