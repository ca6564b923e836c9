// SPDX-License-Identifier: Apache-2.0
// Options that several commands share: one name, one meaning, one description.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>

#include "config/shipped_files.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"

namespace stickslip::command_line {

/// Replaces the name of a shipped file by its path: "beam-1" is models/beam-1.toml in `folder`
/// "models", wherever the program runs. Other paths stay as they are.
inline CLI::Validator shipped_file(const std::string& folder) {
  return CLI::Validator(
      [folder](std::string& name) {
        name = config::file_meant(name, folder).string();
        return std::string();
      },
      "");
}

inline void add_model_option(CLI::App& command, std::string& file) {
  add_input(command, "--model", file, "Model (TOML)")
      ->required()
      ->transform(shipped_file("models"));
}

/// The positional argument RECORDING.
inline void add_recording(CLI::App& command, std::string& file) {
  add_input(command, "RECORDING", file, "Recording (LCM event log or CSV)")->required();
}

/// Of commands that compute: the result as a file, besides the text on standard output.
inline void add_json_file_option(CLI::App& command, std::string& file) {
  add_output(command, "--json", file, "Also write the result as JSON");
}

/// Of commands that show something: JSON on standard output, instead of the text.
inline void add_json_flag(CLI::App& command, bool& json) {
  command.add_flag("--json", json, "Print JSON instead of text");
}

inline void add_jobs_option(CLI::App& command, int& jobs) {
  command.add_option("--jobs", jobs, "Threads (0: one per core)")
      ->check(number_of_threads())
      ->capture_default_str();
}

inline CLI::Option* add_seed_option(CLI::App& command, std::uint64_t& seed) {
  return command.add_option("--seed", seed, "Seed of the random numbers")
      ->check(seed_number())
      ->capture_default_str();
}

inline void add_horizon_option(CLI::App& command, double& horizon_s) {
  command
      .add_option("--horizon", horizon_s,
                  "Length of a prediction [s] (default: one natural period, 0.4 to 1.5 s)")
      ->check(positive_number());
}

inline void add_false_alarm_rate_option(CLI::App& command, double& rate) {
  command
      .add_option("--false-alarm-rate", rate,
                  "Share of recordings without missing physics in which something may be claimed "
                  "by chance; less asks for more evidence")
      ->check(probability())
      ->capture_default_str();
}

/// Of commands that run until they are stopped.
inline void add_stop_after_option(CLI::App& command, double& duration_s) {
  command.add_option("--duration", duration_s, "Stop after this time [s]")
      ->check(positive_number());
}

inline void add_averaging_time_option(CLI::App& command, double& seconds) {
  command.add_option("--seconds", seconds, "Averaging time of a reading [s]")
      ->check(positive_number())
      ->capture_default_str();
}

inline void add_calibration_file_option(CLI::App& command, std::string& file) {
  declare_files(command, FileRole::updated,
                command.add_option("--file", file, "Calibration file (TOML), updated or created"))
      ->required();
}

}  // namespace stickslip::command_line
