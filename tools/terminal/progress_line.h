// The line that tells how far a work is, as a function of time: no clock and no terminal in it.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

namespace stickslip::terminal {

/// How far a work is.
struct Standing {
  std::string what;            ///< what is being done, a few words
  std::optional<double> done;  ///< its share, 0 to 1; absent: nobody knows how much there is
};

/// "12 s", "3 min 20 s", "2 h 5 min", "4 d 7 h": rounded up, so that it is not over before it ends.
std::string duration_text(double seconds);

/// "42 %  fitting, 12 s left", or "listening, 12 s" where the share is not known, in less than
/// `columns` columns: what is said of the work goes first where there is no room. Empty where
/// nothing that helps fits. The time left is what the rest takes at the rate so far.
std::string progress_text(const Standing& standing, double elapsed_s, std::size_t columns);

/// What is written to a terminal, and when.
class ProgressLine {
 public:
  static constexpr double patience_s = 1.0;  ///< what takes no longer is not told of
  static constexpr double period_s = 0.1;    ///< it is not drawn more often

  explicit ProgressLine(double begun_s) : begun_s_(begun_s) {}

  /// The bytes to write at `now_s`; empty where nothing is to be changed.
  std::string draw(double now_s, const Standing& standing, std::size_t columns);

  /// The bytes that take the line away; empty where it is not there.
  std::string erase();

 private:
  double begun_s_;
  std::optional<double> drawn_s_;
  std::string shown_;
};

}  // namespace stickslip::terminal
