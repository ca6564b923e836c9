// SPDX-License-Identifier: Apache-2.0
// Location of a mismatch: relation, channel, times, range of the motion, and frequency band.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/balance_signature.h"
#include "diagnosis/balances.h"
#include "diagnosis/criteria.h"
#include "diagnosis/regions.h"
#include "diagnosis/shooting.h"
#include "physics/effect.h"

namespace stickslip::diagnosis {

struct Location {
  physics::Relation relation = physics::Relation::force_balance;
  std::optional<Channel> channel;
  std::vector<std::pair<double, double>> when_s;
  std::map<std::string, std::pair<double, double>> where;
  std::optional<std::pair<double, double>> band_hz;
  std::string statement;
  std::vector<Region> regions;  ///< conditions under which the mismatch is larger than otherwise
  Balances balances;            ///< measured before any effect was tried
};

/// From the residuals of `fitted` over the windows of `task`; `regions` and `balances` are left
/// empty. A window
/// fails if its chi-squared per sample exceeds `explained_chi2`.
Location locate(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                physics::Relation relation, double explained_chi2, const Criteria& criteria = {});

/// The sentence by which the balances contradict findings that they do not admit.
std::string contradiction_by(const BalanceLocation& location, const Balances& balances);

}  // namespace stickslip::diagnosis
