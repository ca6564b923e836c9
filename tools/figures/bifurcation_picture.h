// SPDX-License-Identifier: Apache-2.0
// Bifurcation diagrams.
#pragma once

#include <string>
#include <vector>

#include "tools/dynamics/bifurcation.h"
#include "tools/figures/gnuplot.h"

namespace stickslip::figures {

/// Labels of the axes, with their units, and the factors from the columns to them.
struct BifurcationAxes {
  std::string parameter;
  std::string displacement;
  std::string exponent;
  double parameter_factor = 1.0;
  double displacement_factor = 1.0;
};

/// Displacements of the sections over the parameter; with exponents, these in a panel below, with
/// a line at 0.
Picture bifurcation_picture(const std::vector<dynamics::BifurcationColumn>& columns,
                            bool with_exponents, const BifurcationAxes& axes,
                            const std::string& stem);

}  // namespace stickslip::figures
