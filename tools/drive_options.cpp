#include "tools/drive_options.h"

#include <cstdio>
#include <numbers>

#include "physics/problem.h"
#include "tools/write_file.h"

namespace stickslip::tools {

dynamics::Drive DriveOptions::drive(const physics::Model& rig) const {
  const auto refuse = [this](const std::string& message) {
    throw InputError(Problem{model, 0, 0, message});
  };
  if (rig.oscillator.excitation == physics::Excitation::imposed) {
    refuse("has imposed motion (excitation = \"imposed\"): it has no orbits of its own");
  }
  if (frequency_hz.has_value() == omega_rad_s.has_value()) {
    refuse("needs the drive's frequency: give either --frequency-hz or --omega");
  }
  if (amplitude.has_value() == acceleration_m_s2.has_value()) {
    refuse("needs the drive's strength: give either --amplitude or --acceleration");
  }
  dynamics::Drive drive;
  drive.omega_rad_s = omega_rad_s.value_or(2.0 * std::numbers::pi * frequency_hz.value_or(0.0));
  if (acceleration_m_s2) {
    drive.acceleration_m_s2 = *acceleration_m_s2;
  } else if (rig.oscillator.excitation == physics::Excitation::base) {
    drive.acceleration_m_s2 = *amplitude * drive.omega_rad_s * drive.omega_rad_s;
  } else {
    drive.acceleration_m_s2 = *amplitude / rig.oscillator.mass_kg.value;
  }
  return drive;
}

void add_drive_options(CLI::App& command, const std::shared_ptr<DriveOptions>& options) {
  command.add_option("--model", options->model, "Model (TOML)")->required();
  command.add_option("--frequency-hz", options->frequency_hz, "Frequency of the drive [Hz]")
      ->check(CLI::PositiveNumber);
  command.add_option("--omega", options->omega_rad_s, "or its angular frequency [rad/s]")
      ->check(CLI::PositiveNumber);
  command
      .add_option("--amplitude", options->amplitude,
                  "Amplitude of the base's motion [m], or of the force [N]")
      ->check(CLI::NonNegativeNumber);
  command
      .add_option("--acceleration", options->acceleration_m_s2,
                  "or the acceleration that it gives the free mass [m/s2]")
      ->check(CLI::NonNegativeNumber);
  command.add_option("--x", options->x_m, "Deflection to start from [m]")->capture_default_str();
  command.add_option("--v", options->v_m_s, "Velocity to start from [m/s]")->capture_default_str();
  command.add_option("--transient", options->transient, "Drive periods that are left out")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      .add_option("--steps", options->steps,
                  "Integration steps per drive period (0: what the rig needs)")
      ->check(CLI::IsMember({0}) | CLI::Range(16, 10000000))
      ->capture_default_str();
}

void write_table(const std::string& file, const std::string& text) {
  if (file == "-") {
    std::fwrite(text.data(), 1, text.size(), stdout);
  } else {
    write_file(file, text);
  }
}

}  // namespace stickslip::tools
