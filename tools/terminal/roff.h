// SPDX-License-Identifier: Apache-2.0
// Text in man(7) markup.
#pragma once

#include <string>
#include <string_view>

namespace stickslip::terminal {

/// Plain text within a line, with roff special characters escaped.
std::string escaped(std::string_view text);

/// Lines of text, ended by a line feed; none of them can be read as a roff request.
std::string paragraph(std::string_view text);

std::string bold(std::string_view text);
std::string italic(std::string_view text);

}  // namespace stickslip::terminal
