// Text of any origin on one line of a terminal.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace stickslip::terminal {

/// Control characters as blanks: what others wrote stays on its line and is no command to the
/// terminal.
std::string printable(std::string_view text);

/// At most `columns` characters of UTF-8, with "..." for what was cut where there is room for it.
std::string cut_to(std::string_view text, std::size_t columns);

/// Characters of UTF-8, each taken for one column.
std::size_t columns_in(std::string_view text);

/// With blanks behind (or before) it, up to so many columns; what is longer stays as it is.
std::string padded(std::string_view text, std::size_t columns);
std::string padded_left(std::string_view text, std::size_t columns);

}  // namespace stickslip::terminal
