// SPDX-License-Identifier: Apache-2.0
#include "tools/terminal/colour.h"

#include <cstdlib>

namespace stickslip::terminal {

namespace {

// The eight standard colours, whose shades follow the colour scheme of the terminal.
const char* sequence_of(Tone tone) {
  switch (tone) {
    case Tone::plain:
      return "";
    case Tone::good:
      return "\033[32m";
    case Tone::note:
      return "\033[36m";
    case Tone::warning:
      return "\033[33m";
    case Tone::bad:
      return "\033[1;31m";
    case Tone::faint:
      return "\033[2m";
  }
  return "";
}

}  // namespace

bool wants_colour(Colours choice, const Abilities& abilities, const char* no_color) {
  if (choice != Colours::automatic) return choice == Colours::always;
  if (no_color != nullptr && *no_color != '\0') return false;
  return abilities.terminal && !abilities.dumb;
}

bool wants_colour(Colours choice, int file) {
  return wants_colour(choice, abilities_of(file), std::getenv("NO_COLOR"));
}

std::string Paint::operator()(Tone tone, std::string_view text) const {
  if (!on_ || tone == Tone::plain || text.empty()) return std::string(text);
  return sequence_of(tone) + std::string(text) + "\033[0m";
}

}  // namespace stickslip::terminal
