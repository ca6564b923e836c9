// How a report looks on a screen, light or dark, wide or narrow, and on paper.
#pragma once

#include <string_view>

namespace stickslip::diagnosis {

/// A style sheet that loads nothing and holds no character that XML would take for markup.
std::string_view report_style();

}  // namespace stickslip::diagnosis
