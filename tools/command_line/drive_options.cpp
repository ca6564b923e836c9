// SPDX-License-Identifier: Apache-2.0
#include "tools/command_line/drive_options.h"

#include <numbers>
#include <stdexcept>

#include "physics/problem.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"

namespace stickslip::command_line {

dynamics::Drive DriveOptions::drive(const physics::Model& rig, int periods, Swept swept) const {
  const auto refuse = [](const std::string& source, const std::string& message) {
    throw InputError(Problem{source, 0, 0, message});
  };
  const auto check_one = [&](bool first, bool second, bool is_swept, const std::string& options,
                             const std::string& quantity) {
    if (first && second) refuse(options, "both are given: expected one of them");
    if (!first && !second && !is_swept) refuse(options, "expected one of them: " + quantity);
  };
  if (rig.oscillator.excitation == physics::Excitation::imposed) {
    refuse(model, "has imposed motion (excitation = \"imposed\"), hence no free orbits");
  }
  check_one(frequency_hz.has_value(), omega_rad_s.has_value(), swept == Swept::frequency,
            "--frequency-hz, --omega", "the drive's frequency");
  check_one(amplitude.has_value(), acceleration_m_s2.has_value(), swept == Swept::strength,
            "--amplitude, --acceleration", "the drive's strength");
  dynamics::Drive drive;
  drive.omega_rad_s = omega_rad_s.value_or(2.0 * std::numbers::pi * frequency_hz.value_or(1.0));
  if (acceleration_m_s2 || !amplitude) {
    drive.acceleration_m_s2 = acceleration_m_s2.value_or(0.0);
  } else if (rig.oscillator.excitation == physics::Excitation::base) {
    drive.acceleration_m_s2 = *amplitude * drive.omega_rad_s * drive.omega_rad_s;
  } else {
    drive.acceleration_m_s2 = *amplitude / rig.oscillator.mass_kg.value;
  }
  if (steps == 0 && periods > 0) {
    try {
      dynamics::enough_steps(rig, drive, transient + periods);
    } catch (const InputError& error) {
      throw of_model(error);
    }
  }
  return drive;
}

InputError DriveOptions::of_model(const InputError& steps) const {
  return InputError(Problem{model, 0, 0, steps.problems().front().message + " (--steps)"});
}

dynamics::PortraitOptions DriveOptions::portrait() const {
  dynamics::PortraitOptions options;
  options.transient = transient;
  options.steps_per_period = steps;
  options.x_m = x_m;
  options.v_m_s = v_m_s;
  return options;
}

void add_drive_options(CLI::App& command, const std::shared_ptr<DriveOptions>& options) {
  add_model_option(command, options->model);
  command.add_option("--frequency-hz", options->frequency_hz, "Frequency of the drive [Hz]")
      ->check(positive_number());
  command.add_option("--omega", options->omega_rad_s, "Angular frequency of the drive [rad/s]")
      ->check(positive_number());
  command
      .add_option("--amplitude", options->amplitude,
                  "Amplitude of the base motion [m] or of the force [N]")
      ->check(not_negative_number());
  command
      .add_option("--acceleration", options->acceleration_m_s2,
                  "Amplitude as acceleration of the free mass [m/s2]")
      ->check(not_negative_number());
  command.add_option("--x", options->x_m, "Initial deflection [m]")
      ->check(finite_number())
      ->capture_default_str();
  command.add_option("--v", options->v_m_s, "Initial velocity [m/s]")
      ->check(finite_number())
      ->capture_default_str();
  command.add_option("--transient", options->transient, "Initial drive periods to discard")
      ->check(whole_number(0, 10000000))
      ->capture_default_str();
  command
      .add_option("--steps", options->steps, "Integration steps per drive period (0: automatic)")
      ->check(number_that(
          [](double v) { return v == 0.0 || (v >= 16.0 && v <= 1.0e7 && v == std::floor(v)); },
          "0, or a whole number from 16 to 10000000"))
      ->capture_default_str();
}

}  // namespace stickslip::command_line
