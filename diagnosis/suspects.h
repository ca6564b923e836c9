// Who could be missing, and what the unexplained part of a recording says about where to start
// looking: its lines, its episodes, the sizes of things.
#pragma once

#include <array>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/experiment.h"
#include "diagnosis/hypothesis.h"
#include "diagnosis/shooting.h"
#include "physics/effects/effect.h"

namespace stickslip::diagnosis {

/// One effect of the catalogue; a sensor effect at one channel.
struct Suspect {
  const physics::Effect* effect = nullptr;
  physics::Place place;

  /// "stribeck", "gain_error of velocity", "crosstalk of velocity from friction_force"
  std::string name() const;
  friend bool operator==(const Suspect&, const Suspect&) = default;
};

/// Everybody that `model` could be lacking and that these recordings could show.
std::vector<Suspect> suspects_of(const physics::Model& model,
                                 std::span<const Experiment> experiments);

/// What a fit leaves, looked at over the whole of the first experiment.
struct Hints {
  std::array<physics::Line, predicted_channels> line;  ///< amplitude 0: none stands out
  std::vector<double> frequencies_hz;
  std::vector<std::pair<double, double>> episodes_s;
};

/// `fitted` belongs to `task`, whose windows cover the recordings.
Hints hints_of(const Task& task, const Hypothesis& hypothesis, const Fit& fitted);

/// From which starting values are made.
physics::Scales scales_of(std::span<const Experiment> experiments, const Hypothesis& hypothesis,
                          std::span<const double> z, const Hints& hints,
                          const physics::Place& place);

}  // namespace stickslip::diagnosis
