// SPDX-License-Identifier: Apache-2.0
// Options for a periodic drive.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>

#include "physics/model.h"
#include "physics/problem.h"
#include "tools/dynamics/portrait.h"

namespace stickslip::command_line {

struct DriveOptions {
  std::string model;
  std::optional<double> frequency_hz;
  std::optional<double> omega_rad_s;
  std::optional<double> amplitude;
  std::optional<double> acceleration_m_s2;
  double x_m = 0.0;
  double v_m_s = 0.0;
  int transient = 200;
  int steps = 0;

  /// Quantity that the caller sweeps; its option is not required.
  enum class Swept { nothing, frequency, strength };

  /// Drive given by the options. Throws InputError if frequency or strength are missing or given
  /// twice, if the motion of the model is imposed, or if so many periods, and the transient,
  /// require too many integration steps (0 periods: the caller checks that, for a sweep).
  dynamics::Drive drive(const physics::Model& model, int periods,
                        Swept swept = Swept::nothing) const;

  /// A refusal of integration steps with the file of the model.
  InputError of_model(const InputError& steps) const;

  /// Start, transient and steps; otherwise the defaults.
  dynamics::PortraitOptions portrait() const;
};

/// Adds --model and the options of the drive, the initial state and the transient to a command.
void add_drive_options(CLI::App& command, const std::shared_ptr<DriveOptions>& options);

}  // namespace stickslip::command_line
