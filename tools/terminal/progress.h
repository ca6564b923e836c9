// SPDX-License-Identifier: Apache-2.0
// Progress of a command on standard error.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

namespace stickslip::terminal {

/// Shows the progress and the time remaining in one line, from the first second on, and erases the
/// line at the end. Silent if standard error is not a terminal, a dumb one, or this is a background
/// job. A separate thread draws, so that reporting progress only stores a number.
///
/// Call `finish` before other output, which would share the line.
class Progress {
 public:
  /// `label`: the current activity, "reading run.log".
  explicit Progress(std::string label);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Share done, 0 to 1. Callable from any thread at any rate.
  void at(double share) noexcept;
  /// `done` items of `all`. Decreasing shares, from threads that overtake each other, are ignored.
  void at(std::size_t done, std::size_t all) noexcept;
  /// Fixed total duration: progress follows the clock.
  void set_duration(double seconds) noexcept;
  /// Changes the label. Callable from any thread, a few times a second at most.
  void set_label(std::string label);
  /// Erases the line and stops drawing.
  void finish() noexcept;

 private:
  class Painter;
  std::unique_ptr<Painter> painter_;  // null if silent
};

}  // namespace stickslip::terminal
