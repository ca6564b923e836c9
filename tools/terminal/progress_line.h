// SPDX-License-Identifier: Apache-2.0
// The progress line as a function of time, independent of clock and terminal.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

namespace stickslip::terminal {

/// State of a task.
struct Status {
  std::string label;           ///< present activity, a few words
  std::optional<double> done;  ///< share done, 0 to 1; absent: the total is unknown
};

/// "12 s", "3 min 20 s", "2 h 5 min", "4 d 7 h": rounded up.
std::string duration_text(double seconds);

/// "42 %  fitting, 12 s left", or "listening, 12 s" if the share is unknown, in less than `columns`
/// columns. The label is shortened first; empty if nothing useful fits. The time left is
/// extrapolated at the mean rate.
std::string progress_text(const Status& status, double elapsed_s, std::size_t columns);

/// Output to the terminal over time.
class ProgressLine {
 public:
  static constexpr double display_delay_s = 1.0;  ///< shorter tasks show nothing
  static constexpr double period_s = 0.1;         ///< shortest time between redraws

  explicit ProgressLine(double start_s) : start_s_(start_s) {}

  /// Bytes to write at `now_s`; empty if the line is unchanged.
  std::string draw(double now_s, const Status& status, std::size_t columns);

  /// Bytes that erase the line; empty if it is not shown.
  std::string erase();

 private:
  double start_s_;
  std::optional<double> drawn_s_;
  std::string shown_;
};

}  // namespace stickslip::terminal
