// SPDX-License-Identifier: Apache-2.0
// The recorder of the true rig: noise, quantisation and the times in the file.
#pragma once

#include <string>

#include "protocol/recording.h"
#include "tools/concealment/noiseless_run.h"
#include "tools/concealment/random_source.h"
#include "tools/concealment/sample_times.h"

namespace stickslip::concealment {

/// The largest 1, 2 or 5 times a power of ten not above `value`.
double round_step(double value);

/// The run as its file holds it.
protocol::Recording recorded(const NoiselessRun& run, const SampleTimes& times,
                             const ReferenceRig& rig, const std::string& source,
                             RandomSource& random);

}  // namespace stickslip::concealment
