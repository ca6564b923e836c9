// SPDX-License-Identifier: Apache-2.0
// Findings as text and as JSON.
#pragma once

#include <string>
#include <vector>

#include "tools/doctor/finding.h"
#include "tools/terminal/colour.h"

namespace stickslip::doctor {

/// One line per finding, its command below, and a last line with the counts.
std::string text(const std::vector<Finding>& findings,
                 const terminal::Paint& paint = terminal::Paint(false));

/// {"schema": 1, "verdict": "warn", "checks": [{"check", "verdict", "found", "command"}, ...]};
/// command is null if there is none.
std::string json(const std::vector<Finding>& findings);

}  // namespace stickslip::doctor
