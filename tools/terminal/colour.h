// Colour where it helps: how bad something is, a verdict, a state. Words never depend on it.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "tools/terminal/abilities.h"

namespace stickslip::terminal {

enum class Colours : std::uint8_t { automatic, always, never };

/// Whether to paint. By itself only a terminal that is not dumb, and not where NO_COLOR
/// (https://no-color.org) is set to anything but nothing; what was asked for goes before both.
bool wants_colour(Colours asked, const Abilities& abilities, const char* no_color);

/// The same for a file descriptor, with NO_COLOR from the environment.
bool wants_colour(Colours asked, int file);

enum class Tone : std::uint8_t { plain, good, note, warning, bad, faint };

/// Paints, or leaves as it is.
class Paint {
 public:
  explicit Paint(bool on) : on_(on) {}
  std::string operator()(Tone tone, std::string_view text) const;
  bool on() const { return on_; }

 private:
  bool on_;
};

}  // namespace stickslip::terminal
