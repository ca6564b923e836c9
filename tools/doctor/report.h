// Findings for a person, and for a program.
#pragma once

#include <string>
#include <vector>

#include "tools/doctor/finding.h"
#include "tools/terminal/colour.h"

namespace stickslip::doctor {

/// One line for each finding, with its command below where it has one, and a last line that counts.
std::string text(const std::vector<Finding>& findings,
                 const terminal::Paint& paint = terminal::Paint(false));

/// {"schema": 1, "verdict": "warn", "checks": [{"check", "verdict", "found", "command"}, ...]};
/// command is null where there is none.
std::string json(const std::vector<Finding>& findings);

}  // namespace stickslip::doctor
