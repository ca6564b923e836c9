// SPDX-License-Identifier: Apache-2.0
// Pictures of a reduction, as in Figures 3 and 4 of the paper.
#pragma once

#include <string>
#include <vector>

#include "tools/figures/gnuplot.h"
#include "tools/reduction/reduction.h"

namespace stickslip::figures {

/// mu over (x, v): cells with their scatter, and the samples.
Picture mu_surface(const reduction::Reduction& reduced, const std::string& stem);
/// The same seen from above: the mean of mu in each cell as a colour, white at 0.
Picture mu_map(const reduction::Reduction& reduced, const std::string& stem);
/// The samples in the (x, v) plane.
Picture phase_sweep(const reduction::Reduction& reduced, const std::string& stem);
/// mu against v, and mu against x: the hysteresis loops.
Picture mu_against_velocity(const reduction::Reduction& reduced, const std::string& stem);
Picture mu_against_displacement(const reduction::Reduction& reduced, const std::string& stem);
/// N against x with its regression line.
Picture load_against_displacement(const reduction::Reduction& reduced, const std::string& stem);

/// All six; the stems are "surface", "map", "sweep", "mu-v", "mu-x" and "n-x".
std::vector<Picture> reduction_pictures(const reduction::Reduction& reduced);

/// CSV tables: a header and one row per sample or cell.
std::string samples_csv(const reduction::Reduction& reduced);
std::string surface_csv(const reduction::Reduction& reduced);

}  // namespace stickslip::figures
