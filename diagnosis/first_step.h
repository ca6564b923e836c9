// SPDX-License-Identifier: Apache-2.0
// The first step of a candidate effect: its size, the calibration and the window states at once, to
// first order, by one Jacobian of the model without it.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "diagnosis/fitted_candidate.h"
#include "diagnosis/nuisance_projection.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// An effect after its step, and the decrease of the cost to first order, beyond what a step
/// without the effect gains.
struct FirstStep {
  FittedCandidate candidate;
  double gain = 0.0;
};

/// First steps of effects added to one fit.
class FirstSteps {
 public:
  /// `states`: of the windows of the task, fitted with `base`. All must outlive it.
  FirstSteps(const Task& task, const FittedCandidate& base, const std::vector<WindowState>& states);

  /// The effect after its step, from that of its starts which gains most to first order. The start
  /// says what the effect looks like, not how large it is: its strength is that of the step. None
  /// for what has no first order here: an effect that replaces a law of the base or brings states
  /// with it, one without a strength, a number or a comparison of recordings.
  std::optional<FirstStep> after(const CandidateEffect& candidate,
                                 std::span<const std::vector<double>> starts,
                                 std::span<const double> fixed) const;

  /// Cost of the fit without an effect, after a step of its own.
  double cost_without() const { return moved({}, {*base_.hypothesis, {}, {}, 0.0}).fitted.cost; }

 private:
  // Size of one unknown of the effect, from where there is none of it.
  struct Direction {
    std::size_t unknown = 0;
    double none = 0.0;  // its value without the effect
    double unit = 1.0;  // for which the change is
    bool positive = false;
  };
  // An effect from one of its starts, and the changes of the readings by units of it.
  struct Sized {
    Hypothesis hypothesis;
    std::vector<Direction> directions;
    std::vector<Change> changes;
    double gain = 0.0;  // to first order
  };

  Change change_at(const Hypothesis& with, std::span<const double> z) const;
  std::vector<double> unchanged(const Hypothesis& with) const;
  std::optional<Change> scaled_change(const Hypothesis& with, Direction& direction) const;
  std::optional<Sized> sized(const CandidateEffect& candidate, const Hypothesis& with) const;
  static std::vector<double> stepped(const Sized& sized, const Response& response,
                                     std::vector<double> z);
  FittedCandidate moved(const CandidateEffect& candidate, const Sized& sized) const;

  const Task& task_;
  const FittedCandidate& base_;
  const std::vector<WindowState>& states_;
  std::vector<NuisanceProjection> damped_;  // the first one: not at all
  double cost_ = 0.0;                       // of the base
};

}  // namespace stickslip::diagnosis
