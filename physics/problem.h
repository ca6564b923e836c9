// SPDX-License-Identifier: Apache-2.0
// Errors in input files, with their position.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace stickslip {

/// One error. `line` and `column` count from 1; 0 where unknown (for a binary log the message
/// states the byte offset). The message states what was found, what was expected and, where it is
/// not obvious, the remedy.
struct Problem {
  std::string file;
  int line = 0;
  int column = 0;
  std::string message;

  /// "file:line:column: message" without the parts that are unknown.
  std::string text() const {
    std::string out = file;
    if (line > 0) out += ':' + std::to_string(line);
    if (column > 0) out += ':' + std::to_string(column);
    if (!out.empty()) out += ": ";
    return out + message;
  }

  friend bool operator==(const Problem&, const Problem&) = default;
};

/// Invalid input: the program exits with status 2 and one line on standard error. Holds every
/// problem found, the one to correct first at the front; never empty.
class InputError : public std::runtime_error {
 public:
  explicit InputError(std::vector<Problem> problems)
      : std::runtime_error(line_for(problems)), problems_(std::move(problems)) {}
  explicit InputError(Problem problem) : InputError(std::vector<Problem>{std::move(problem)}) {}

  const std::vector<Problem>& problems() const { return problems_; }

 private:
  static std::string line_for(const std::vector<Problem>& problems) {
    if (problems.empty()) return "bad input";
    std::string out = problems.front().text();
    if (problems.size() > 1) {
      out += " (and " + std::to_string(problems.size() - 1) + " more: `stickslip check " +
             problems.front().file + "` lists all)";
    }
    return out;
  }
  std::vector<Problem> problems_;
};

}  // namespace stickslip
