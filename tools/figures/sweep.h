// SPDX-License-Identifier: Apache-2.0
// A recording of a simulated rig under a base motion of one frequency with modulated amplitude, as
// a hand-turned knob produces it.
#pragma once

#include <cstdint>

#include "physics/model.h"
#include "protocol/recording.h"

namespace stickslip::figures {

struct Sweep {
  double frequency_hz = 2.5;
  double amplitude_m = 0.01;   ///< the largest
  double modulation_hz = 0.0;  ///< of the amplitude; 0: constant
  double modulation_depth = 0.9;
  double transient_s = 0.0;  ///< before the recording begins
  double duration_s = 10.0;
  double rate_hz = 1000.0;
  std::uint64_t seed = 1;
  bool noise = true;
};

/// The base starts from rest and from displacement 0. Throws std::invalid_argument for a model that
/// is inconsistent or not driven by its base.
protocol::Recording record(const physics::Model& model, const Sweep& sweep);

}  // namespace stickslip::figures
