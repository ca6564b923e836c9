// Progress of what a command does, on standard error, for a person who waits.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

namespace stickslip::terminal {

/// Tells how far a work is from its first second on, in one line with the time that is left, and
/// takes the line away when it ends. It is silent where standard error is no terminal, a dumb one,
/// or that of another job. A thread of its own draws: whoever works only stores a number.
///
/// What is printed while one lives would stand in its line: call `finish` before.
class Progress {
 public:
  /// `what` is being done: "reading run.log".
  explicit Progress(std::string what);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// The share that is done, 0 to 1. From any thread, as often as one likes.
  void at(double share) noexcept;
  /// `done` pieces of `all`; shares that went back, since threads overtake each other, count not.
  void at(std::size_t done, std::size_t all) noexcept;
  /// The work takes so long by the clock, whatever is done meanwhile.
  void takes(double seconds) noexcept;
  /// What is being done now. From any thread, a few times a second at most.
  void say(std::string what);
  /// Takes the line away; nothing is drawn from then on.
  void finish() noexcept;

 private:
  class Painter;
  std::unique_ptr<Painter> painter_;  // none where nobody looks
};

}  // namespace stickslip::terminal
