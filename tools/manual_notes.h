// What the manual pages say of commands beyond their options.
#pragma once

#include <string_view>

#include "tools/manual/page.h"

namespace stickslip::tools {

/// Of the command of that name; of the program for "". A command that has none has a page
/// nevertheless.
manual::Notes manual_notes(std::string_view command);

}  // namespace stickslip::tools
