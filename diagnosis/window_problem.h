// SPDX-License-Identifier: Apache-2.0
// The least-squares problem of multiple shooting, window by window: residuals, their derivatives,
// and each window's part of the normal equations.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "diagnosis/shooting.h"
#include "diagnosis/window_derivatives.h"
#include "diagnosis/window_simulation.h"
#include "physics/rig.h"
#include "physics/sensor_chain.h"

namespace stickslip::diagnosis {

/// Prior of a window's state, wide enough for the data to decide wherever they can.
struct StatePrior {
  WindowState centre{};
  WindowState sigma{};
  WindowState hidden{};  ///< typical size of each state that no channel shows, else 0
};
StatePrior state_prior(const Experiment& e, const Window& window, const Hypothesis& hypothesis,
                       std::span<const double> parameters);

/// One window's part of the normal equations; p: parameters, s: states in units of their priors.
struct NormalBlock {
  Eigen::MatrixXd pp, ps, ss;
  Eigen::VectorXd gp, gs;
  double chi2 = 0.0;
  int count = 0;
  double prior = 0.0;

  /// Robust loss of the residuals, and the prior.
  double cost() const;
  /// Chi-squared per residual.
  double mean_square() const;
};

class WindowProblem {
 public:
  /// By row, in which it is written.
  using Jacobian = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  /// State priors follow from the parameters at `z` and stay fixed.
  WindowProblem(const Task& task, const Hypothesis& hypothesis, std::span<const double> z,
                bool parameters_free);

  std::size_t unknowns() const { return unknowns_; }
  /// States of the rig that are free in each window; the knots of the drive's error follow them.
  std::size_t states() const { return rig_states_; }
  std::size_t free_in_window() const { return states_.size(); }

  /// Sets the parameters at which windows are evaluated. Throws Interrupted if Task::stop is
  /// requested.
  void prepare(std::span<const double> z);

  /// Chi-squared, residual count and state prior of one window; no derivatives.
  NormalBlock evaluate(std::size_t w, const WindowState& from) const;

  /// Scaled residuals of a window and their derivatives with respect to each unknown (first) and
  /// each free state.
  struct Derivatives {
    Jacobian jacobian;
    Eigen::VectorXd residual;
  };
  Derivatives differentiate(std::size_t w, const WindowState& from) const;

  /// Scaled residuals of a window, in the order of their derivatives.
  Eigen::VectorXd residual(std::size_t w, const WindowState& from) const;

  /// Distances of the free states from the centres of their priors, in units of these.
  Eigen::VectorXd offsets(std::size_t w, const WindowState& from) const;

  NormalBlock linearise(std::size_t w, const WindowState& from) const;

  /// `from` moved by a step in units of the state priors.
  WindowState moved(std::size_t w, const WindowState& from, const Eigen::VectorXd& step) const;

  /// Starts that differ from the first guess in one state that no channel shows.
  std::vector<WindowState> alternative_starts(std::size_t w) const;

  /// True if the preceding window of the task ends where this one begins.
  bool follows_on(std::size_t w) const;

  /// State of the preceding window, integrated from `from` to where this one begins to settle.
  WindowState propagated(std::size_t w, const WindowState& from) const;

  double parameter_prior(std::span<const double> z) const;

 private:
  std::size_t end_of(std::size_t w) const;
  double state_offset(std::size_t w, int state, const WindowState& at) const;
  void add_priors(std::size_t w, const WindowState& at, NormalBlock& block) const;
  WindowRun run_of(std::size_t w, Steps steps) const;
  struct InstrumentColumn {
    Eigen::Index column = 0;
    std::size_t channel = 0;
    physics::InstrumentQuantity quantity{};
  };

  // Unknowns that act in a recording, and its numbers.
  struct Columns {
    std::vector<Eigen::Index> parameters;  // but for the next
    std::vector<InstrumentColumn> instruments;
  };

  Columns columns_of(std::size_t recording) const;
  void set_numbers(std::span<const double> z);
  Directions directions(std::size_t w) const;
  void differentiate_instruments(const Experiment& e, std::size_t c, double reading, double rate,
                                 Eigen::Index row, Jacobian& jacobian) const;
  NormalBlock diverged(int count) const;

  const Task& task_;
  const Hypothesis& hypothesis_;
  std::vector<int> states_;     // indices into WindowState
  std::size_t rig_states_ = 0;  // of these, the first
  std::size_t unknowns_;
  std::vector<Columns> columns_;                   // by recording
  std::vector<physics::SensorBank> banks_;         // by experiment, for the steps of the task
  std::vector<physics::SensorBank> coarse_banks_;  // for those of the derivatives
  std::vector<StatePrior> priors_;
  std::vector<std::vector<double>> parameters_;  // by recording
  std::vector<double> z_;
  std::vector<physics::RigNumbers<double>> numbers_;  // by recording
};

}  // namespace stickslip::diagnosis
