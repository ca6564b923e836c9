// SPDX-License-Identifier: Apache-2.0
// Campaigns for the tests of the diagnosis.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "physics/campaign.h"

namespace stickslip::diagnosis::test {

/// Recordings under these loads, named by their numbers.
inline physics::Campaign under_loads(const std::vector<double>& loads_n,
                                     std::vector<physics::SharedNumber> numbers = {}) {
  physics::Campaign out;
  for (const double load_n : loads_n) {
    physics::Run run;
    run.name = std::to_string(out.runs.size() + 1);
    run.conditions["load_n"] = load_n;
    out.runs.push_back(run);
  }
  out.numbers = std::move(numbers);
  return out;
}

}  // namespace stickslip::diagnosis::test
