// SPDX-License-Identifier: Apache-2.0
// The eight questions whose answers make a model. Each is an option of `stickslip model new`, too,
// and both accept the same answers.
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "tools/interview/draft.h"

namespace stickslip::interview {

struct Question {
  std::string_view option;    ///< "--mass"
  std::string_view title;     ///< on a line of its own
  std::string_view help;      ///< description of the option
  std::string_view meaning;   ///< sentences for a person at a bench
  std::string_view examples;  ///< answers, as they may be typed
  bool (*applies)(const Draft&);
  /// The answer that is taken if a person just presses Enter; empty: none.
  std::string (*proposal)(const Draft&);
  /// Puts the answer into the model. Returns the problem as "expected ..., found ...", or "".
  std::string (*take)(Draft&, std::string_view answer);
};

inline constexpr std::size_t question_count = 8;

/// In the order in which they are asked: an answer decides whether later ones apply.
const std::array<Question, question_count>& questions();

}  // namespace stickslip::interview
