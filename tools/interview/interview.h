// SPDX-License-Identifier: Apache-2.0
// Asks the questions whose answers make a model.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>

#include "tools/interview/draft.h"
#include "tools/interview/questions.h"

namespace stickslip::interview {

/// Shows a text that ends with a prompt and returns the line that was typed; none at the end of the
/// input.
using Ask = std::function<std::optional<std::string>(const std::string& text)>;

struct Setup {
  std::map<std::string, std::string> answers;  ///< given beforehand, by option: "--mass"
  Measured recorded{};                         ///< channels of a recording; all false without one
  Ask ask;                                     ///< absent: no person answers
};

/// The model that results. Questions without an answer beforehand are asked, again after an answer
/// that cannot be used. Throws InputError that names the option: of an answer beforehand that
/// cannot be used or does not apply, of all that are missing where no person answers, and at the
/// end of the input.
Draft interviewed(const Setup& setup);

}  // namespace stickslip::interview
