// What a model reads, less what the noise of the base's own channel can explain of its residuals.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// What a model reads in a window, sample by sample from its beginning.
using Readings = std::vector<std::array<double, predicted_channels>>;

/// By window of the task, from these parameters and states. Where the base is doubted, its most
/// probable error in each window, given the residuals, is taken out.
std::vector<Readings> readings_of(const Task& task, const Hypothesis& hypothesis,
                                  std::span<const double> z, const std::vector<WindowState>& state);

}  // namespace stickslip::diagnosis
