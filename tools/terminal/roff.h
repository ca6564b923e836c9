// Text as man(7) takes it.
#pragma once

#include <string>
#include <string_view>

namespace stickslip::terminal {

/// Plain text within a line: backslashes and hyphens are what they are.
std::string escaped(std::string_view text);

/// Text of its own lines: none of them is taken for a request.
std::string paragraph(std::string_view text);

std::string bold(std::string_view text);
std::string italic(std::string_view text);

}  // namespace stickslip::terminal
