// SPDX-License-Identifier: Apache-2.0
// Where a recording departs from a model, before any effect is tried: the five balances
// (balance_equations.h), each compared with noise and calibration.
//
// The floor of a balance - noise through its equation, reversals between samples, filters inverted
// inexactly - is that of one simulated recording of the calibrated model with the same drive,
// instruments, noise and missing samples, treated by the same code. BalanceResiduals are whitened
// by its spectrum and weighted by its energy at that speed: near a reversal measured velocity says
// little of friction. Every number that the model states with a standard deviation may shift,
// linearly, under its prior and within Criteria::contradicted_sigmas: what stays within is an
// instrument.
//
// Parity relations, as in fault isolation; what they say together: balance_signature.h.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string_view>

#include "diagnosis/balance_equations.h"
#include "diagnosis/criteria.h"
#include "physics/campaign.h"
#include "physics/model.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

struct BalanceResidual {
  double excess = 1.0;  ///< residual energy over that of the simulated recording
  /// Probability of at least that excess from noise and calibration alone. Twice the smaller of
  /// two: of the energy over all blocks (three periods of the motion each; paired jackknife of the
  /// logarithm of the ratio, Student's t), and of the largest block among those of the simulated
  /// recording (log-normal, Bonferroni), which finds what does not last.
  double p = 1.0;
};

struct Balances {
  /// Empty where the balance cannot be measured.
  std::array<std::optional<BalanceResidual>, balance_count> of;
  /// Covariance of what force balance and friction law have beyond the simulated recording, over
  /// the smaller of their energies, -1 to 1. An error of the measured friction force enters both
  /// alike: then 1, whatever else enters one of them. Empty where either has nothing.
  std::optional<double> force_and_friction;

  const std::optional<BalanceResidual>& operator[](Balance balance) const {
    return of[index_of(balance)];
  }
};

/// Recordings, and the model before and after its calibration.
struct BalanceCase {
  std::span<const protocol::Recording> recordings;
  std::span<const Experiment> experiments;      ///< one per recording
  const physics::Model& declared;               ///< with the priors of its instruments
  const physics::Model& calibrated;             ///< the same numbers, fitted
  const physics::Campaign* campaign = nullptr;  ///< that the recordings are of, if any
};

/// The longest stretch without a gap of every recording counts, at most 2^17 samples of it.
/// Deterministic for a seed, whatever the number of threads.
Balances balances_of(const BalanceCase& measured, std::uint64_t seed, int threads,
                     const Criteria& criteria = {});

/// "force_balance"
std::string_view name_of(Balance balance);

}  // namespace stickslip::diagnosis
