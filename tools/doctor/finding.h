// What a check found, and the command that mends it.
#pragma once

#include <string>
#include <string_view>

namespace stickslip::doctor {

enum class Verdict {
  ok,
  note,  ///< nothing is wrong; worth knowing
  warn,  ///< the rig runs, worse than it could
  fail,  ///< the rig will not run as its configuration says, or not safely
};

/// "ok", "note", "warn", "fail".
std::string_view name_of(Verdict verdict);

struct Finding {
  std::string check;  ///< what was looked at, in two or three words
  Verdict verdict = Verdict::ok;
  std::string found;    ///< what was found, one line
  std::string command;  ///< for a shell, to be copied as it is; empty where all is well
};

/// With three digits, or all of those before the point.
std::string number(double value);

/// A path or a URL as one word of a shell.
std::string shell_word(const std::string& word);

}  // namespace stickslip::doctor
