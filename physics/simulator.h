// SPDX-License-Identifier: Apache-2.0
// Simulated rig: integrates a Model under given inputs and reads its sensors, with their filters,
// noise and quantisation. Deterministic for a seed.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "physics/frame.h"
#include "physics/input.h"
#include "physics/model.h"

namespace stickslip::physics {

/// The true mechanical state of the simulated rig, without sensors and noise.
struct RigTruth {
  double displacement_m = 0.0;
  double velocity_m_s = 0.0;
  double load_cell_deflection_m = 0.0;
  double load_cell_velocity_m_s = 0.0;
  double slip_velocity_m_s = 0.0;
  double theta = 0.0;
  double friction_force_n = 0.0;
  double normal_load_n = 0.0;
};

struct SimulationOptions {
  double step_s = 1.0e-4;  ///< longest integration step
  std::uint64_t seed = 1;  ///< of the sensor noise
  bool noise = true;       ///< Gaussian, with the model's noise_std where one is declared
  std::array<double, channel_count> resolution{};  ///< quantisation step per channel; 0: none
};

class RigSimulator {
 public:
  /// The rig at rest (or at `start`) at time 0 with zero input. Allocates all memory that it needs
  /// later. Throws std::invalid_argument where inconsistencies_of(model) is not empty.
  explicit RigSimulator(const Model& model, SimulationOptions options = {},
                        const RigTruth& start = {});
  ~RigSimulator();
  RigSimulator(RigSimulator&&) noexcept;
  RigSimulator& operator=(RigSimulator&&) noexcept;

  /// Sets the current input without advancing time.
  void set_input(const Input& now);

  /// Advances time by `duration_s` > 0 while the input goes linearly from its current value to
  /// `end`. Does not allocate.
  void advance(double duration_s, const Input& end);

  /// The current readings. The rig has the channels of the model's own quantities
  /// (friction_force only where there is friction, normal_load where a normal load is declared,
  /// base_displacement on base-excited and drive_force on force-excited rigs). The sequence number
  /// counts readings from 0.
  Frame read();

  const RigTruth& truth() const;
  double time_s() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace stickslip::physics
