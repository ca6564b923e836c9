// The residuals of a model by frequency.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "tools/diagnose/shooting.h"

namespace stickslip::diagnosis {

/// What a model reads in a window, sample by sample from its beginning.
using Readings = std::vector<std::array<double, predicted_channels>>;

/// A residual over the noise, or a large number for a model that blew up: it tells nothing more
/// than that.
double bounded(double residual);

/// Mean power of the residuals of channel `c` over the noise, over all windows of the first
/// experiment that are as long as its first, by frequency; 1 is white noise. `readings` by window
/// of the task.
std::vector<double> mean_power(const Task& task, const std::vector<Readings>& readings,
                               std::size_t c, double period_s, std::vector<double>& frequency_hz);

}  // namespace stickslip::diagnosis
