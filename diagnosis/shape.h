// What a fitted effect looks like: the quantity that it changes, over the variable that it depends
// on, for a report's JSON and for its pictures.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/experiment.h"
#include "physics/effects/effect.h"

namespace stickslip::diagnosis {

/// A quantity of the fitted physics over one variable.
struct Curve {
  std::string variable;  ///< "displacement"
  std::string variable_unit;
  std::string quantity;  ///< "force on the mass"
  std::string unit;
  std::vector<double> at;
  std::vector<double> value;
  /// 95 % interval at each point, from the doubt of all fitted parameters of the effect together;
  /// empty where it is not known.
  std::vector<double> low = {}, high = {};
};

/// How an effect with these parameters (in the order of its card) depends on what it acts on, over
/// the range of a recording. Empty for what is no function of one variable: faults of sensors,
/// hidden states.
std::vector<Curve> shape_of(const physics::Effect& effect, std::span<const double> parameters,
                            const Experiment& experiment);

/// The same for a person: also faults of sensors, loops of effects that remember, laws that replace
/// another, and what is periodic over a few periods only. `like` are the parameters from which the
/// range of the drawing follows, so that curves of like parameters can be compared point by point.
/// `friction_n` is the friction force of the model under its mean load.
std::vector<Curve> portrait_of(const physics::Effect& effect, const physics::Place& place,
                               std::span<const double> parameters, std::span<const double> like,
                               const Experiment& experiment, double friction_n);

/// Gives every curve its 95 % interval to first order: `changed(i, by)` are the same curves with
/// the i-th unknown moved by so many of its standard deviations, `correlation` is that of the
/// unknowns.
void add_bands(std::vector<Curve>& curves, const Eigen::MatrixXd& correlation,
               const std::function<std::vector<Curve>(Eigen::Index, double)>& changed);

}  // namespace stickslip::diagnosis
