// SPDX-License-Identifier: Apache-2.0
// How well a level and a colour of the noise predict what a hypothesis leaves: scores of different
// noise can be compared.
#pragma once

#include <span>

#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// Negative log-likelihood of the readings in the windows of `task` under its noise [nat], up to a
/// constant of the data. States of the windows are fitted and marginalised.
double noise_loss(const Task& task, const Hypothesis& hypothesis, std::span<const double> z);

}  // namespace stickslip::diagnosis
