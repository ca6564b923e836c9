// SPDX-License-Identifier: Apache-2.0
// A study as one page, and the picture of a run.
#pragma once

#include <string>

#include "diagnosis/design/drive.h"
#include "tools/investigation/study.h"

namespace stickslip::investigation {

/// Peaks of a run beside their limits, its duration, and what it is expected to separate; several
/// lines of text.
std::string question_text(const Question& question, const RigFacts& facts);

/// The verdict after a run and the hypotheses with their probabilities; several lines of text.
std::string answer_text(const Step& step);

/// The drive over time with its limits, a file of its own.
std::string picture_of(const design::Drive& drive, const Question& question, const RigFacts& facts);

/// study.html; without external resources.
std::string page_of(const Study& study);

}  // namespace stickslip::investigation
