// SPDX-License-Identifier: Apache-2.0
// The style sheet of a report: screen, light or dark, wide or narrow, and paper.
#pragma once

#include <string_view>

namespace stickslip::report {

/// Without external resources; needs no escaping in XML.
std::string_view report_style();

}  // namespace stickslip::report
