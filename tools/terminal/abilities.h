// SPDX-License-Identifier: Apache-2.0
// Capabilities of the terminal behind a file descriptor.
#pragma once

#include <cstddef>

namespace stickslip::terminal {

/// Capabilities of a file descriptor for display.
struct Abilities {
  bool terminal = false;  ///< a terminal, not a pipe or file
  bool dumb = false;      ///< no control sequences: TERM is "dumb" or unset
};

/// Queries the system and $TERM.
Abilities abilities_of(int file);

/// Present width and height in characters; 0 if unknown.
std::size_t columns_of(int file);
std::size_t lines_of(int file);

/// False if this process is a background job of the terminal, whose output would disturb the
/// foreground job.
bool in_foreground(int file);

}  // namespace stickslip::terminal
