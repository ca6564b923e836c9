// SPDX-License-Identifier: Apache-2.0
// Work with a person that a stop signal ends.
#pragma once

#include <stop_token>
#include <string>
#include <thread>

#include "tools/telemetry/lcm_client.h"

namespace stickslip::telemetry {

/// Asks the tokens of a computation to stop once a stop signal arrives.
class StopOnSignal {
 public:
  /// `signals` must outlive it.
  explicit StopOnSignal(const StopSignals& signals);
  std::stop_token token() const { return source_.get_token(); }

 private:
  std::stop_source source_;
  std::jthread watcher_;
};

struct TypedLine {
  enum class Kind {
    line,
    end,     ///< of the input; the text may hold a line without its end
    stopped  ///< a stop was requested meanwhile
  };
  Kind kind = Kind::line;
  std::string text;
};

/// A line of standard input; a stop request, whose signal is blocked, ends the wait.
TypedLine typed_line(const std::stop_token& stop);

}  // namespace stickslip::telemetry
