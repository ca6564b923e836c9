// SPDX-License-Identifier: Apache-2.0
// When a study ends, and why.
#pragma once

#include <optional>
#include <string>

#include "tools/investigation/questions.h"
#include "tools/investigation/study.h"

namespace stickslip::investigation {

struct Decision {
  Ending ending = Ending::open;
  std::string words;
};

/// "98.7 %", "more than 99.9 %".
std::string probability_text(double share);

/// That of the least certain finding: "98.7 %", "at least 98.7 %" of several.
std::string least_words(const Step& last);

/// True after a step whose diagnosis needs no further run: the findings explain the recordings and
/// each has what counts as certain, or nothing is missing in two runs of different kinds.
bool is_named(const Study& study, std::size_t steps);

/// Whether the study goes on with `next` after its first `steps`; nothing next: no run is possible.
Decision decide(const Study& study, std::size_t steps, const std::optional<NextRun>& next);

}  // namespace stickslip::investigation
