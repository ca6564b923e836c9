// The style sheet of a report: screen, light or dark, wide or narrow, and paper.
#pragma once

#include <string_view>

namespace stickslip::report {

/// Loads nothing and needs no escaping in XML.
std::string_view report_style();

}  // namespace stickslip::report
