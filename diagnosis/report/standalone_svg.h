// SPDX-License-Identifier: Apache-2.0
// A plot as a file of its own.
#pragma once

#include <string>

namespace stickslip::report {

/// The inline SVG of plot_svg.h with the namespace, the rules of the style sheet that it uses and a
/// white background, for viewers that know neither the page nor CSS variables. Empty if `svg` is.
std::string standalone_svg(const std::string& svg);

}  // namespace stickslip::report
