// Under which conditions a model fails: when, where in phase space, sticking or sliding, at which
// phase of the drive, in which band. Every condition of every channel is a test; together they are
// wrong in at most one of twenty that they name.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/experiment.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// What a condition is about.
enum class Aspect : std::uint8_t {
  time,          ///< [s] in the recording
  displacement,  ///< [m]
  velocity,      ///< [m/s]
  motion,        ///< sticking, reversing, sliding forwards or backwards: no limits
  drive_phase,   ///< [rad], 0 at the crest of what drives the rig
  band,          ///< [Hz]
};

/// A condition under which the residuals of one channel are larger than otherwise.
struct Region {
  Channel channel = Channel::displacement;
  Aspect aspect = Aspect::time;
  double from = 0.0;  ///< in the unit of the aspect
  double to = 0.0;
  std::string words;            ///< "while it sticks", "at displacements from ... to ... m"
  double energy = 0.0;          ///< mean square of the residual there, over the noise variance
  double energy_outside = 0.0;  ///< and everywhere else
  double p_value = 1.0;  ///< of a difference as large as that, were the condition of no matter
};

/// The conditions that are named, the plainest first. `fitted` belongs to `task`. Windows are
/// redrawn (a block bootstrap: samples within a window depend on each other) for the error of every
/// difference; Benjamini and Yekutieli's rule keeps the share of false ones below 5 %, whatever the
/// tests have to do with each other. Deterministic for a seed.
std::vector<Region> regions_of(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                               std::uint64_t seed);

std::string_view name_of(Aspect aspect);

}  // namespace stickslip::diagnosis
