// Short-window multiple shooting: every window starts from a free state, the sensor filters are
// part of the model, and the parameters are shared. It survives chaos and hidden states, which a
// free run and a regression do not. Gauss-Newton with Levenberg-Marquardt damping; window states
// are eliminated by a Schur complement; windows that a model cannot follow count only
// logarithmically.
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "diagnosis/experiment.h"
#include "diagnosis/hypothesis.h"

namespace stickslip::diagnosis {

/// Which window of which experiment.
struct WindowRef {
  std::size_t experiment = 0;
  std::size_t window = 0;
};

/// The base's acceleration comes from a noisy channel. What it is wrong by in a window is a line
/// through so many knots, whose heights are as large as that noise allows.
inline constexpr int base_knots = 16;

/// By how much the readings of a window change for a knot one standard deviation high: one row for
/// each residual, in the channel's unit, one column for each knot. The product with its transpose
/// is the covariance that the base's noise gives to the residuals.
using BaseResponse = Eigen::Matrix<double, Eigen::Dynamic, base_knots>;

using WindowState = std::array<double, physics::max_rig_states>;

/// The windows to fit or to score, and how their residuals are weighed.
struct Task {
  std::span<const Experiment> experiments;
  std::vector<WindowRef> windows;
  std::array<double, predicted_channels> sigma{};  ///< residuals are divided by it, by channel
  /// By window; empty: the base is known exactly.
  std::vector<std::shared_ptr<const BaseResponse>> base_response = {};
  double share = 1.0;  ///< only this share of each window, from its beginning, is compared
  int threads = 1;
  /// Told of each window whose states were fitted while the unknowns are held, from the thread that
  /// did it; may be empty.
  std::function<void()> window_done = {};
};

struct Fit {
  std::vector<double> z;           ///< of the unknowns
  std::vector<WindowState> state;  ///< at the `warm` sample, by window of the task
  std::vector<double> chi2;        ///< sum of squared scaled residuals, by window
  std::vector<int> count;          ///< residuals, by window
  int states_per_window = 0;
  Eigen::MatrixXd covariance;  ///< of z, from the curvature at the solution (unscaled)
  double cost = 0.0;           ///< with the capped loss and all priors
  int iterations = 0;

  /// Sum of squares per degree of freedom over all windows; window states are counted as fitted.
  double chi2_per_sample() const;
};

struct FitOptions {
  int iterations = 14;
  bool parameters_free = true;  ///< false: only the window states are fitted
  double tolerance = 1.0e-4;    ///< relative fall of the cost at which the search ends
  bool covariance = true;       ///< false: Fit::covariance is not wanted
  bool rescue = true;  ///< windows followed much worse than most are tried from other starts
};

/// First guesses of the window states from the experiment's wide-band channels.
std::vector<WindowState> guessed_states(const Task& task, const Hypothesis& hypothesis);

/// The states `from`, found under `old_hypothesis`, for a hypothesis that may have states which the
/// other lacks: those are guessed.
std::vector<WindowState> carried(const std::vector<WindowState>& from, const Task& task,
                                 const Hypothesis& old_hypothesis, const Hypothesis& hypothesis);

/// How a doubt of the base's acceleration would show in the windows of `task`, for
/// Task::base_response; empty where the base is not doubted. `states` need not be exact.
std::vector<std::shared_ptr<const BaseResponse>> base_response_of(
    const Task& task, const Hypothesis& hypothesis, std::span<const double> z,
    const std::vector<WindowState>& states);

/// Fits unknowns and window states, starting from `z` and `states`.
Fit fit(const Task& task, const Hypothesis& hypothesis, std::vector<double> z,
        std::vector<WindowState> states, const FitOptions& options = {});

/// Fits the window states alone, with the covariance that the base's noise gives to residuals under
/// this hypothesis (whatever Task::base_response is).
Fit fit_states(const Task& task, const Hypothesis& hypothesis, std::span<const double> z,
               FitOptions options = {});

/// How the scaled residuals of a window change with everything that a fit may choose.
struct WindowJacobian {
  Eigen::MatrixXd parameters;  ///< residuals x unknowns of the hypothesis
  /// Residuals x what each window chooses for itself, in units of its prior: states, and the knots
  /// of a doubted base.
  Eigen::MatrixXd free;
  Eigen::VectorXd residual;
};
std::vector<WindowJacobian> jacobians_of(const Task& task, const Hypothesis& hypothesis,
                                         std::span<const double> z,
                                         const std::vector<WindowState>& states);

/// The scaled residuals of one window of the task, in the order of WindowJacobian's rows.
Eigen::VectorXd residuals_of(const Task& task, std::size_t window, const Hypothesis& hypothesis,
                             std::span<const double> z, const WindowState& state);

/// What the model reads in a window from that state: `readings[i]` belongs to sample begin + i, up
/// to `end` (which may lie beyond the window's own).
std::vector<std::array<double, predicted_channels>> predict(const Experiment& experiment,
                                                            const Window& window, std::size_t end,
                                                            const Hypothesis& hypothesis,
                                                            std::span<const double> z,
                                                            const WindowState& state);

}  // namespace stickslip::diagnosis
