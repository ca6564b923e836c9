// What the manual pages say of commands beyond their options.
#pragma once

#include <string_view>

#include "tools/terminal/manual_page.h"

namespace stickslip::terminal {

/// Of the command of that name; of the program for "". A command that has none has a page
/// nevertheless.
terminal::Notes manual_notes(std::string_view command);

}  // namespace stickslip::terminal
