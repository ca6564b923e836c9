// SPDX-License-Identifier: Apache-2.0
// The verdict of a diagnosis in one sentence, and the rig it is about.
#pragma once

#include <string>

#include "diagnosis/diagnosis.h"

namespace stickslip::report {

/// Kind of result. `partial`: findings that leave more than noise; `ambiguous`: a finding with a
/// probability below 95 % and at least one alternative.
enum class Answer { consistent, named, partial, ambiguous, unexplained };
Answer answer_of(const diagnosis::Diagnosis& diagnosis);

/// Whether the first alternative is at least half as probable.
bool has_rival(const diagnosis::Finding& finding);

/// Gain [standard errors] below which it is not significant. (Windows with very different gains
/// have a large standard error, so a larger limit would deny clear findings.)
inline constexpr double significant_gain_z = 1.0;

/// "hardening spring (52 %) or end stop (48 %)"; without the other where it is less than half as
/// probable.
std::string explanations_text(const diagnosis::Finding& finding);

/// A sentence after a blank where chi-squared is far below 1; else empty.
std::string fit_remark(const diagnosis::Diagnosis& diagnosis);

/// One or two sentences.
std::string headline_of(const diagnosis::Diagnosis& diagnosis);

/// " The noise of velocity is 1.3 times the declared one.": a sentence for every channel whose
/// noise is of another level, each after a blank; empty for none.
std::string noise_level_text(const diagnosis::Diagnosis& diagnosis);

/// One sentence with the parameter values of `model`.
std::string rig_description(const physics::Model& model);

}  // namespace stickslip::report
