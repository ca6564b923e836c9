// SPDX-License-Identifier: Apache-2.0
// A model while its author is being asked.
#pragma once

#include <array>

#include "physics/frame.h"
#include "physics/model.h"

namespace stickslip::interview {

/// The channels that a rig measures, by Channel.
using Measured = std::array<bool, channel_count>;

struct Draft {
  physics::Model model;
  Measured measured{};

  bool measures(Channel channel) const { return measured[index_of(channel)]; }
  bool imposed() const { return model.oscillator.excitation == physics::Excitation::imposed; }
  bool has_spring() const {
    const physics::Oscillator& oscillator = model.oscillator;
    return oscillator.natural_frequency_hz ||
           (oscillator.stiffness_n_m && oscillator.stiffness_n_m->value > 0.0);
  }
};

}  // namespace stickslip::interview
