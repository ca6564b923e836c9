// SPDX-License-Identifier: Apache-2.0
// Poincaré sections over a range of one parameter.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tools/dynamics/portrait.h"

namespace stickslip::dynamics {

struct BifurcationOptions {
  PortraitOptions portrait;
  int threads = 1;
  bool with_exponents = false;  ///< also the largest exponent at every value
  /// If "drive.frequency_hz" is swept: the constant base amplitude. Absent: the acceleration is
  /// kept constant.
  std::optional<double> base_amplitude_m;
  /// Called after each value, from any of the threads but one at a time; may be empty.
  std::function<void(std::size_t done, std::size_t all)> progress;
};

struct BifurcationColumn {
  double value = 0.0;  ///< of the parameter
  std::vector<Point> section;
  double exponent_per_s = 0.0;  ///< if requested
};

/// Paths of the parameters that a diagram can be drawn over: the model's ("friction.mu"), and the
/// drive's "drive.frequency_hz", "drive.acceleration_m_s2" and, of a base-excited rig,
/// "drive.amplitude_m".
std::vector<std::string> bifurcation_paths(const physics::Model& model);

/// The reason why the parameter cannot have this value; empty if it can.
std::string refusal(const physics::Model& model, const std::string& path, double value);

/// One column per value, in the order of the values. Every value starts from the same initial
/// state, so the diagram does not depend on the number of threads. Throws std::invalid_argument for
/// a path that is not among bifurcation_paths, and for a value that `refusal` rejects.
std::vector<BifurcationColumn> bifurcation(const physics::Model& model, const Drive& drive,
                                           const std::string& path,
                                           const std::vector<double>& values,
                                           const BifurcationOptions& options = {});

}  // namespace stickslip::dynamics
