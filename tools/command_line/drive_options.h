// How a command is told what drives a rig periodically.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>

#include "physics/model.h"
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

  /// What the caller will set itself, over and over, and which therefore need not be told.
  enum class Swept { nothing, frequency, strength };

  /// The drive that was asked for. Throws InputError where it is not told, or not by one option
  /// only, where the model's motion is imposed, and where a period of the drive holds more steps of
  /// the rig than anyone can wait for.
  dynamics::Drive drive(const physics::Model& model, Swept swept = Swept::nothing) const;

  /// Start, transient and steps; the rest is as it stands there.
  dynamics::PortraitOptions portrait() const;
};

/// Adds --model, the drive, the start and the transient to a command.
void add_drive_options(CLI::App& command, const std::shared_ptr<DriveOptions>& options);

}  // namespace stickslip::command_line
