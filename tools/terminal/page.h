// SPDX-License-Identifier: Apache-2.0
// Pages of text on standard output.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace stickslip::terminal {

/// Lines of at most `columns` characters (0: unlimited), broken at blanks. What is broken off
/// continues under the last column of the line, or behind its indentation. Words that are too long
/// are cut; a line with a command to copy, which begins with "$ ", stays whole. Control sequences
/// of colours take no width.
std::string fitted(std::string_view text, std::size_t columns);

/// Width of a page on this file: $COLUMNS, or that of the terminal; 0 (unlimited) for other files,
/// which are read by programs.
std::size_t page_columns(int file);

/// Prints text that ends with a line break on standard output, fitted to its width.
void print_page(std::string_view text);

/// The same for text in the manner of printf.
[[gnu::format(printf, 1, 2)]] void print(const char* format, ...);

}  // namespace stickslip::terminal
