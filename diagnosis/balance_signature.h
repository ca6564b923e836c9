// SPDX-License-Identifier: Apache-2.0
// Where balances that fail together put a mismatch: which part of the description, or which
// channel, is wrong.
#pragma once

#include <optional>

#include "diagnosis/balances.h"
#include "physics/effect.h"
#include "physics/model.h"

namespace stickslip::diagnosis {

/// Thresholds of a signature, set by hand from the table of docs/diagnosis.md.
struct SignatureLimits {
  double p = 1.0e-3;    ///< of a balance that departs, at most
  double share = 0.3;   ///< of the largest excess over 1 from which another balance fails with it
  double common = 0.8;  ///< Balances::force_and_friction from which the friction channel is wrong
};

struct BalanceLocation {
  Balance largest = Balance::force_balance;  ///< of the largest excess
  physics::Relation relation = physics::Relation::force_balance;
  std::optional<Channel> channel;
};

/// By the signatures of docs/diagnosis.md; empty where no balance, or that of the drive alone,
/// departs significantly, and where all others do: then the noise is not as stated.
std::optional<BalanceLocation> location_by(const Balances& balances, const physics::Model& model,
                                           const SignatureLimits& limits = {});

/// False if the balances exclude that a mismatch of that relation (for sensor errors: in that
/// channel) is what fails. Two relations that meet in one measured balance do not exclude each
/// other.
bool admits(const BalanceLocation& location, const Balances& balances, physics::Relation relation,
            std::optional<Channel> channel);

}  // namespace stickslip::diagnosis
