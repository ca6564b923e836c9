// SPDX-License-Identifier: Apache-2.0
// How a program ends after an error, in words for the person at the terminal.
#pragma once

#include <exception>
#include <stdexcept>
#include <string>

namespace stickslip {

/// A foreseen failure that no input causes: a daemon that does not answer, a full disk. what() is a
/// sentence with the object, the reason and, where it is not obvious, the remedy. Exit status 1.
class Failure : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Exit status of a program and its one line on standard error.
struct Ending {
  int status = 1;
  std::string line;
  bool foreseen = true;
};

/// Ending of `program` by `error`. Only InputError and Failure speak for themselves: the text of
/// any other exception is written for programmers, so an unforeseen one becomes a request for a
/// report.
Ending ending_of(const std::exception& error, const std::string& program);

}  // namespace stickslip
