// SPDX-License-Identifier: Apache-2.0
// Curves of a fitted effect: the quantity that it changes over the variable that it depends on, for
// a report's JSON and its figures.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/experiment.h"
#include "physics/effect.h"

namespace stickslip::diagnosis {

/// A quantity of the fitted physics over one variable.
struct Curve {
  std::string variable;  ///< "displacement"
  std::string variable_unit;
  std::string quantity;  ///< "force on the mass"
  std::string unit;
  std::vector<double> at;
  std::vector<double> value;
  /// 95 % interval at each point, from the covariance of all fitted parameters of the effect; empty
  /// where unknown.
  std::vector<double> low = {}, high = {};
};

/// The terms of an effect with these parameters (in the order of its card) over each variable, in
/// the range of a recording. Empty for sensor errors and for effects with states, which are not
/// functions of one variable.
std::vector<Curve> shape_of(const physics::Effect& effect, std::span<const double> parameters,
                            const Experiment& experiment);

/// The same for figures: also sensor errors, loops of effects with states, laws that replace
/// another, and oscillations over a few periods only. Ranges follow from the parameters
/// `reference`, so that curves of similar parameters can be compared point by point. `friction_n`:
/// friction force of the model at its mean load.
std::vector<Curve> portrait_of(const physics::Effect& effect, const physics::Place& place,
                               std::span<const double> parameters,
                               std::span<const double> reference, const Experiment& experiment,
                               double friction_n);

/// Adds 95 % intervals to first order: `changed(i, by)` returns the same curves with the i-th
/// unknown moved by `by` of its standard deviations; `correlation` is that of the unknowns.
void add_bands(std::vector<Curve>& curves, const Eigen::MatrixXd& correlation,
               const std::function<std::vector<Curve>(Eigen::Index, double)>& changed);

}  // namespace stickslip::diagnosis
