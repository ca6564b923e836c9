// SPDX-License-Identifier: Apache-2.0
#include "tools/terminal/abilities.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>
#include <string_view>

namespace stickslip::terminal {

namespace {

winsize size_of(int file) {
  winsize size{};
  if (ioctl(file, TIOCGWINSZ, &size) != 0) return {};
  return size;
}

}  // namespace

Abilities abilities_of(int file) {
  const char* term = std::getenv("TERM");
  return {isatty(file) != 0, term == nullptr || *term == '\0' || std::string_view(term) == "dumb"};
}

std::size_t columns_of(int file) { return size_of(file).ws_col; }

std::size_t lines_of(int file) { return size_of(file).ws_row; }

bool in_foreground(int file) {
  const pid_t front = tcgetpgrp(file);
  return front < 0 || front == getpgrp();  // negative: no job control
}

}  // namespace stickslip::terminal
