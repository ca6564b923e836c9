// SPDX-License-Identifier: Apache-2.0
// Sensor readings of a model under the drive of a recording.
#pragma once

#include <string>

#include "physics/model.h"
#include "physics/simulator.h"
#include "protocol/progress_callback.h"
#include "protocol/recording.h"

namespace stickslip::processing {

/// The readings at the times of `drive`, which holds base_displacement_m, drive_force_n or, for
/// imposed motion, displacement_m, and normal_load_n where the law of the load is "measured".
/// Between samples the input is linear. Errors name the model as `model_name`. Throws InputError if
/// `drive` has fewer than 5 samples, a gap of more than an hour or a sample without its drive, or
/// if the model cannot be simulated over its length.
protocol::Recording simulated(const physics::Model& model, const std::string& model_name,
                              const protocol::Recording& drive,
                              const physics::SimulationOptions& options,
                              const protocol::ProgressCallback& done = {});

}  // namespace stickslip::processing
