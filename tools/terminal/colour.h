// SPDX-License-Identifier: Apache-2.0
// Colours for verdicts and states. The text carries the same information.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "tools/terminal/abilities.h"

namespace stickslip::terminal {

enum class Colours : std::uint8_t { automatic, always, never };

/// True if output is to be coloured. `automatic` requires a terminal that is not dumb, and NO_COLOR
/// (https://no-color.org) unset or empty.
bool wants_colour(Colours choice, const Abilities& abilities, const char* no_color);

/// The same for a file descriptor, with NO_COLOR from the environment.
bool wants_colour(Colours choice, int file);

enum class Tone : std::uint8_t { plain, good, note, warning, bad, faint };

/// Colours text, or returns it unchanged.
class Paint {
 public:
  explicit Paint(bool on) : on_(on) {}
  std::string operator()(Tone tone, std::string_view text) const;
  bool on() const { return on_; }

 private:
  bool on_;
};

}  // namespace stickslip::terminal
