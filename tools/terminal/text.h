// SPDX-License-Identifier: Apache-2.0
// Text of unknown origin on one line of a terminal.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace stickslip::terminal {

/// Replaces control characters by blanks, so that foreign text neither breaks the line nor controls
/// the terminal.
std::string printable(std::string_view text);

/// At most `columns` characters of UTF-8, with "..." for the rest if `columns` > 6.
std::string cut_to(std::string_view text, std::size_t columns);

/// Number of UTF-8 characters; each is assumed to take one column.
std::size_t columns_in(std::string_view text);

/// Padded with blanks behind (before) the text to `columns`; longer text is unchanged.
std::string padded(std::string_view text, std::size_t columns);
std::string padded_left(std::string_view text, std::size_t columns);

}  // namespace stickslip::terminal
