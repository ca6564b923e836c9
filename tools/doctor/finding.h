// SPDX-License-Identifier: Apache-2.0
// Result of a check and its remedy.
#pragma once

#include <string>
#include <string_view>

namespace stickslip::doctor {

enum class Verdict {
  ok,
  note,  ///< for information
  warn,  ///< the rig runs with reduced quality
  fail,  ///< the rig does not run as configured, or not safely
};

/// "ok", "note", "warn", "fail".
std::string_view name_of(Verdict verdict);

struct Finding {
  std::string check;  ///< name of the check, two or three words
  Verdict verdict = Verdict::ok;
  std::string found;    ///< result in one line
  std::string command;  ///< shell command that solves the problem; empty if there is none
};

/// Number to three significant digits, or to all digits before the decimal point.
std::string short_number(double value);

/// A path or URL quoted as one shell word.
std::string shell_word(const std::string& word);

}  // namespace stickslip::doctor
