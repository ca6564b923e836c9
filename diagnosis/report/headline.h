// SPDX-License-Identifier: Apache-2.0
// The verdict of a diagnosis in one sentence, and the rig it is about.
#pragma once

#include <string>

#include "diagnosis/diagnosis.h"

namespace stickslip::report {

/// Kind of result. `ambiguous`: a finding with a probability below 95 % and at least one
/// alternative.
enum class Answer { consistent, named, ambiguous, unexplained };
Answer answer_of(const diagnosis::Diagnosis& diagnosis);

/// One sentence.
std::string headline_of(const diagnosis::Diagnosis& diagnosis);

/// " The noise of velocity is 1.3 times the declared one.": a sentence for every channel whose
/// noise is of another level, each after a blank; empty for none.
std::string noise_level_text(const diagnosis::Diagnosis& diagnosis);

/// One sentence with the parameter values of `model`.
std::string rig_description(const physics::Model& model);

}  // namespace stickslip::report
