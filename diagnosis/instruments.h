// SPDX-License-Identifier: Apache-2.0
// Default uncertainties of gains, offsets, delays and cut-offs, for models that do not declare
// them.
#pragma once

#include "diagnosis/experiment.h"
#include "physics/model.h"

namespace stickslip::diagnosis {

/// The model with a standard deviation for the gain, offset, delay and cut-offs of every channel
/// that it is compared with, and for gain, offset and cut-offs of the drive's, where it does not
/// declare them (docs/formats.md, section 3): 0.5 %, 1 % of the channel's standard deviation, 0.3
/// samples, and 2 %. Delays count from the drive's channel. What the model declares stays; a gain,
/// offset or delay that is a plain number is exact.
physics::Model with_instruments(physics::Model model, const Experiment& experiment);

}  // namespace stickslip::diagnosis
