// SPDX-License-Identifier: Apache-2.0
// Results of the acceptance of a bench, and their file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace stickslip::commissioning {

enum class Verdict {
  passed,
  failed,
  not_done,       ///< left out by the person, or interrupted
  not_applicable  ///< the bench has nothing that this step tests
};

/// "passed", "failed", "not done", "not applicable".
std::string_view name_of(Verdict verdict);

/// A number that a step measured.
struct Measured {
  std::string name;             ///< "displacement.zero", in which the part after the point is fixed
  double value = 0.0;           ///< in the unit
  std::optional<double> sigma;  ///< standard uncertainty, if known
  std::string unit;
};

struct StepRecord {
  std::string step;  ///< identifier: "polarity"
  Verdict verdict = Verdict::not_done;
  std::string date;    ///< ISO 8601, UTC
  std::string text;    ///< findings, sentences
  std::string remedy;  ///< of a failed step: what to do
  std::vector<Measured> measured;
};

/// The value of a measured number; none if the step has not measured it.
std::optional<Measured> measured_of(const StepRecord& step, std::string_view name);

struct Record {
  std::string rig;      ///< name of the rig
  std::string program;  ///< version that began it
  std::string begun;    ///< ISO 8601, UTC
  std::string devices;  ///< as they name themselves; empty: not identified yet
  /// Keys of the bench and their values as TOML, or the signs of the calibrations' gains.
  std::vector<std::pair<std::string, std::string>> settings;
  /// Sentences about settings that were changed during the acceptance.
  std::vector<std::string> changes;
  std::vector<StepRecord> steps;  ///< in the order in which they were last made

  const StepRecord* find(std::string_view step) const;
  /// Replaces an earlier one of the same step.
  void put(StepRecord step);
};

/// JSON with a line at its end.
std::string json_of(const Record& record);

/// Throws InputError, which names the file, if it is no record.
Record parse_record(const std::string& text, const std::string& file);

/// None if there is no such file. Throws InputError as parse_record.
std::optional<Record> load_record(const std::filesystem::path& file);

/// "commissioned.json", in the folder of an acceptance.
inline constexpr const char* record_name = "commissioned.json";

/// The folder beside a rig's file, named after it: "bench.toml" -> "bench.commissioned".
std::filesystem::path folder_beside(const std::filesystem::path& rig_file);

}  // namespace stickslip::commissioning
