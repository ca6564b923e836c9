// SPDX-License-Identifier: Apache-2.0
// Channels that measure something else than their column says: dead, stuck, reversed, exchanged or
// in another unit. No physics is looked for in them. Judged by what holds for every rig, without a
// fit: velocity is the rate of displacement, forces balance, friction takes energy from the motion,
// a mass without a drive gains none.
#pragma once

#include <optional>
#include <string>

#include "physics/model.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

/// The first such channel in words: its column, what was found, what was expected, what to do.
/// Nothing is said unless the evidence is overwhelming: an effect of the catalogue is no fault, and
/// neither is a wrong model.
std::optional<std::string> channel_fault(const protocol::Recording& recording,
                                         const physics::Model& model);

/// Throws InputError with that sentence.
void refuse_faulty_channels(const protocol::Recording& recording, const physics::Model& model);

}  // namespace stickslip::diagnosis
