// SPDX-License-Identifier: Apache-2.0
#include "physics/failure.h"

#include <new>
#include <system_error>

#include "physics/problem.h"

namespace stickslip {

Ending ending_of(const std::exception& error, const std::string& program) {
  if (dynamic_cast<const InputError*>(&error) != nullptr) return {2, error.what()};
  if (dynamic_cast<const Failure*>(&error) != nullptr) return {1, error.what()};
  if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr) {
    return {1,
            "the free memory does not suffice: close other programs, or use a shorter recording"};
  }
  if (const auto* at = dynamic_cast<const std::system_error*>(&error)) {
    return {1, "the operating system refused a request: " + at->code().message()};
  }
  return {1,
          "this is an error in " + program +
              ", not in your files. Please report it with this command line, the input files and "
              "the line that `" +
              program + " --version` prints; STICKSLIP_DETAILS=1 adds a line for the report",
          false};
}

}  // namespace stickslip
