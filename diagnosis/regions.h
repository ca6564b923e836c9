// SPDX-License-Identifier: Apache-2.0
// Conditions under which a model fails: time, region of phase space, state of motion, phase of the
// drive, frequency band. Every condition of every channel is one test; the false discovery rate of
// all tests together is controlled.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/criteria.h"
#include "diagnosis/experiment.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// Quantity that a condition restricts.
enum class Aspect : std::uint8_t {
  time,          ///< [s] in the recording
  displacement,  ///< [m]
  velocity,      ///< [m/s]
  motion,        ///< sticking, reversing, sliding forwards or backwards; without limits
  drive_phase,   ///< [rad], 0 at the crest of the drive
  band,          ///< [Hz]
};

/// Condition under which the residuals of one channel are larger than otherwise.
struct Region {
  Channel channel = Channel::displacement;
  Aspect aspect = Aspect::time;
  double from = 0.0;  ///< in the unit of the quantity
  double to = 0.0;
  std::string words;            ///< "while it sticks", "at displacements from ... to ... m"
  double energy = 0.0;          ///< mean square of the residual there, over the noise variance
  double energy_outside = 0.0;  ///< the same everywhere else
  double p_value = 1.0;         ///< of that difference, if the condition were irrelevant
};

/// The significant conditions, the most significant first. `fitted` belongs to `task`. The error of
/// every difference is from a block bootstrap over windows, whose samples depend on each other; the
/// procedure of Benjamini and Yekutieli bounds the false discovery rate whatever the dependence
/// between tests. Deterministic for a seed.
std::vector<Region> regions_of(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                               std::uint64_t seed, const Criteria& criteria = {});

std::string_view name_of(Aspect aspect);

}  // namespace stickslip::diagnosis
