// SPDX-License-Identifier: Apache-2.0
#include "tools/doctor/finding.h"

#include <cmath>

#include "physics/number_text.h"

namespace stickslip::doctor {

std::string_view name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::ok:
      return "ok";
    case Verdict::note:
      return "note";
    case Verdict::warn:
      return "warn";
    case Verdict::fail:
      return "fail";
  }
  return "";
}

std::string short_number(double value) {
  constexpr int all_digits = 17;
  return std::abs(value) >= 100.0 ? physics::number_text(std::nearbyint(value), all_digits)
                                  : physics::number_text(value);
}

std::string shell_word(const std::string& word) {
  constexpr const char* plain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_@%+=:,./-";
  if (!word.empty() && word.find_first_not_of(plain) == std::string::npos) return word;
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + '\'';
}

}  // namespace stickslip::doctor
