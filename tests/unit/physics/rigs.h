// SPDX-License-Identifier: Apache-2.0
// Rigs shared by several tests.
#pragma once

#include "physics/model.h"

namespace stickslip::physics::test {

/// The bench of the paper: 2.4 Hz, Coulomb friction, constant load, resonant load cell.
inline Model bench() {
  Model model;
  model.oscillator.mass_kg = {0.06};
  model.oscillator.natural_frequency_hz = Parameter{2.4};
  model.oscillator.damping_ratio = Parameter{0.015};
  model.normal_load = NormalLoad{NormalLoadLaw::constant, {0.15}, {}};
  model.friction.law = FrictionLaw::coulomb;
  model.friction.mu = {0.8};
  model.friction.transition_speed_m_s = {0.0025};
  model.load_cell = LoadCell{{0.0126}, {19.3}, {0.016}, LoadCellDynamics::resonant};
  return model;
}

/// The same with rigid attachment instead of the load cell.
inline Model rigid_bench() {
  Model model = bench();
  model.load_cell.reset();
  return model;
}

}  // namespace stickslip::physics::test
