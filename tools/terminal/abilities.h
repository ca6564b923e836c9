// What stands behind a file descriptor: a terminal that a person looks at, or something else.
#pragma once

#include <cstddef>

namespace stickslip::terminal {

/// What can be shown there.
struct Abilities {
  bool terminal = false;  ///< a terminal, and no pipe or file
  bool dumb = false;      ///< it understands no control sequences: TERM is "dumb", or not set
};

/// Asks the system and $TERM.
Abilities abilities_of(int file);

/// Its width and height in characters, as they are now; 0 where nobody knows.
std::size_t columns_of(int file);
std::size_t lines_of(int file);

/// False where the terminal belongs to another job of the shell just now: what is written by a job
/// in the background disturbs the one in front.
bool in_foreground(int file);

}  // namespace stickslip::terminal
