// SPDX-License-Identifier: Apache-2.0
// Multiple shooting over short windows: every window starts from a free state, the sensor filters
// are part of the model, and the parameters are shared. Unlike a free run or a regression it copes
// with chaos and hidden states. Gauss-Newton with Levenberg-Marquardt damping; window states are
// eliminated by a Schur complement; the cost of outlying windows grows only logarithmically.
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <span>
#include <stdexcept>
#include <stop_token>
#include <vector>

#include "diagnosis/experiment.h"
#include "diagnosis/hypothesis.h"
#include "diagnosis/noise_colour.h"

namespace stickslip::diagnosis {

/// Thrown out of a fit whose task was asked to stop.
struct Interrupted : std::runtime_error {
  Interrupted() : std::runtime_error("interrupted") {}
};

/// A window of an experiment, by index.
struct WindowRef {
  std::size_t experiment = 0;
  std::size_t window = 0;
};

/// Free numbers of a window: the rig's state at `warm`, then the knots of the drive's error, in
/// units of Experiment::drive_noise. Nonlinear in both, unlike a covariance of residuals: a chaotic
/// rig amplifies the drive's noise beyond what a linear response describes.
using WindowState = std::array<double, physics::max_rig_states + max_drive_knots>;

/// Predicted readings of a window, by sample from its `begin`.
using Readings = std::vector<std::array<double, predicted_channels>>;

/// The windows to fit or to score, and the weights of their residuals.
struct Task {
  std::span<const Experiment> experiments;
  std::vector<WindowRef> windows;
  /// Residuals are divided by it, by channel, times the ratio of the experiment.
  std::array<double, predicted_channels> sigma{};
  NoiseColours colour{};      ///< residuals are whitened by it
  double share = 1.0;         ///< leading share of each window that is compared
  Steps steps = Steps::fine;  ///< of the residuals; their derivatives take coarse ones
  int threads = 1;
  /// Called for every window whose states were fitted with the unknowns held, from the thread that
  /// fitted it; may be empty.
  std::function<void()> window_done = {};
  /// Fits end with Interrupted at their next step once this is requested, from any thread.
  std::stop_token stop = {};

  /// The noise of a channel in one of the experiments.
  double sigma_of(const Experiment& e, std::size_t c) const { return sigma[c] * e.noise_ratio[c]; }
  const Experiment& experiment(std::size_t w) const { return experiments[windows[w].experiment]; }
  const Window& window(std::size_t w) const { return experiment(w).windows[windows[w].window]; }
};

struct Fit {
  std::vector<double> z;           ///< of the unknowns
  std::vector<WindowState> state;  ///< at the `warm` sample, by window of the task
  /// Sum of squared scaled residuals and knots of the drive's error, by window.
  std::vector<double> chi2;
  std::vector<int> count;     ///< residuals, by window
  int states_per_window = 0;  ///< of the rig
  /// Cost of the free states of each window [nat], by Laplace's approximation of the marginal
  /// likelihood: half the log determinant of their information in units of the priors, and the
  /// prior at the solution. A fit without derivatives counts 1 for each state.
  std::vector<double> state_cost;
  Eigen::MatrixXd covariance;  ///< of z, from the curvature at the solution (unscaled)
  /// Of z, by leaving out each block of neighbouring windows in turn, one Newton step each, and of
  /// the priors. Holds where residuals are correlated or the model is not exact (CR3: MacKinnon and
  /// White 1985; Cameron and Miller 2015, section VI).
  Eigen::MatrixXd jackknife;
  int blocks = 0;     ///< of windows, left out in turn
  double cost = 0.0;  ///< robust loss and all priors
  int iterations = 0;

  /// Sum of squares per degree of freedom over all windows; window states count as fitted.
  double chi2_per_sample() const;

  /// Half width of the 95 % interval of an unknown, in z: of the curvature, widened where the fit
  /// leaves more than the noise, or of the blocks, whichever is wider. Blocks show correlated
  /// residuals and an inexact model, but not the uncertainty of what acts in one block only. 0
  /// where the fit has no covariance.
  double half_width_95(std::size_t unknown) const;

  /// Standard deviation of an unknown, in z, that belongs to this interval.
  double standard_deviation(std::size_t unknown) const { return half_width_95(unknown) / 1.96; }

  /// False where no reading and no prior depends on the unknown: its interval is without meaning.
  bool is_determined(std::size_t unknown) const;
};

/// A hypothesis with values of its unknowns and, where needed, the states of a task's windows.
struct FittedHypothesis {
  const Hypothesis* hypothesis = nullptr;
  std::span<const double> z;
  const std::vector<WindowState>* state = nullptr;
};

struct FitOptions {
  int iterations = 14;
  bool parameters_free = true;  ///< false: only the window states are fitted
  double tolerance = 1.0e-4;    ///< relative decrease of the cost at which the iteration ends
  /// Share of what the fit leaves beyond the noise (cost above the number of residuals) that one
  /// more iteration has to gain: a model that lacks physics creeps, to no end.
  double excess_tolerance = 1.0e-3;
  /// Steps of the states of a window alone where it does not follow its linearisation, at the edge
  /// of a slip for example: it would shorten the steps of all others.
  int own_steps = 4;
  bool covariance = true;  ///< false: Fit::covariance is not needed
  bool multistart = true;  ///< windows that fit much worse than most are started elsewhere
  /// With multistart: a window begins with the better of the given states and those of a fit from
  /// the first guesses. Costs as much as a fit of the states.
  bool start_anew = true;
};

/// Options of a fit that only has to rank candidates or starts.
FitOptions brief_fit(int iterations);

/// First guesses of the window states from the experiment's wide-band channels.
std::vector<WindowState> initial_states(const Task& task, const Hypothesis& hypothesis);

/// Warm start: the states `from` of `old_hypothesis` for `hypothesis`; states that only the latter
/// has take their first guess.
std::vector<WindowState> warm_start_states(const std::vector<WindowState>& from, const Task& task,
                                           const Hypothesis& old_hypothesis,
                                           const Hypothesis& hypothesis);

/// Fits unknowns and window states, starting from `z` and `states`.
Fit fit(const Task& task, const Hypothesis& hypothesis, std::vector<double> z,
        std::vector<WindowState> states, const FitOptions& options = {});

/// Fits the window states alone, from their first guesses.
Fit fit_states(const Task& task, const Hypothesis& hypothesis, std::span<const double> z,
               FitOptions options = {});

/// Weight of a window with that sum of `count` squared residuals in the normal equations: below 1
/// for an outlier.
double robust_weight(double chi2, int count);

/// Derivatives of the scaled residuals of a window.
struct WindowJacobian {
  Eigen::MatrixXd parameters;  ///< residuals x unknowns of the hypothesis
  /// Residuals x nuisance parameters of the window, in units of their priors: its states, and the
  /// knots of the drive's error.
  Eigen::MatrixXd free;
  Eigen::VectorXd offset;  ///< of these from the centres of their priors, in the same units
  Eigen::VectorXd residual;
};
std::vector<WindowJacobian> jacobians_of(const Task& task, const Hypothesis& hypothesis,
                                         std::span<const double> z,
                                         const std::vector<WindowState>& states);

/// Scaled residuals of one window of the task, in the order of WindowJacobian's rows.
Eigen::VectorXd residuals_of(const Task& task, std::size_t window, const Hypothesis& hypothesis,
                             std::span<const double> z, const WindowState& state);

/// Readings of the model in a window from that state: element i belongs to sample begin + i, up to
/// `end`, which may lie beyond the window's own.
Readings predict(const Experiment& experiment, const Window& window, std::size_t end,
                 const Hypothesis& hypothesis, std::span<const double> z, const WindowState& state,
                 Steps steps = Steps::fine);

}  // namespace stickslip::diagnosis
