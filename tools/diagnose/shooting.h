// Short-window multiple shooting: every window starts from a free state, the sensor filters are
// part of the model, and the parameters are shared. It survives chaos and hidden states, which a
// free run and a regression do not. Gauss-Newton with Levenberg-Marquardt damping; window states
// are eliminated by a Schur complement; windows that a model cannot follow count only
// logarithmically.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "tools/diagnose/experiment.h"
#include "tools/diagnose/hypothesis.h"

namespace stickslip::diagnosis {

/// Which window of which experiment.
struct WindowRef {
  std::size_t experiment = 0;
  std::size_t window = 0;
};

/// The windows to fit or to score, and how their residuals are weighed.
struct Task {
  std::span<const Experiment> experiments;
  std::vector<WindowRef> windows;
  std::array<double, predicted_channels> sigma{};  ///< residuals are divided by it, by channel
  double share = 1.0;  ///< only this share of each window, from its beginning, is compared
  int threads = 1;
};

using WindowState = std::array<double, physics::max_rig_states>;

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
  bool rescue = true;  ///< windows followed much worse than most are tried from other starts
};

/// First guesses of the window states from the experiment's wide-band channels.
std::vector<WindowState> guessed_states(const Task& task, const Hypothesis& hypothesis);

/// Fits unknowns and window states, starting from `z` and `states`.
Fit fit(const Task& task, const Hypothesis& hypothesis, std::vector<double> z,
        std::vector<WindowState> states, const FitOptions& options = {});

/// What the model reads in a window from that state: `readings[i]` belongs to sample begin + i, up
/// to `end` (which may lie beyond the window's own).
std::vector<std::array<double, predicted_channels>> predict(const Experiment& experiment,
                                                            const Window& window, std::size_t end,
                                                            const Hypothesis& hypothesis,
                                                            std::span<const double> z,
                                                            const WindowState& state);

}  // namespace stickslip::diagnosis
