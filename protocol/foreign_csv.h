// SPDX-License-Identifier: Apache-2.0
// CSV files of other programs: semicolons or tabs, decimal commas, quoted headers, units in the
// header or by rule, further columns. What is not said is guessed, what cannot be decided refused.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/progress_callback.h"
#include "protocol/recording.h"

namespace stickslip::protocol {

/// Knowledge of a column. Absent fields are taken from the header.
struct ColumnRule {
  /// As in the header, with or without its unit; or the stem or the column of the channel.
  std::string column;
  std::optional<std::string> channel = {};  ///< "time", a stem or a column of a channel, "ignore"
  std::optional<std::string> unit = {};     ///< "mm", "ms", "kN", ...
  double factor = 1.0;                      ///< of the values, besides that of the unit
};

struct ImportedRecording {
  Recording recording;
  /// The guesses, one sentence each: separators, columns with their units, ignored columns.
  std::vector<std::string> guesses;
};

/// Throws InputError with file, line and expectation for what cannot be decided: no time, a column
/// without a unit, a name that fits two channels, a rule without a column, digits in groups, text
/// in a number, time that does not increase. Empty cells and "NaN" are samples not measured.
ImportedRecording import_csv(std::string_view text, const std::string& name,
                             std::span<const ColumnRule> rules, const ProgressCallback& done = {});

/// As read_recording for logs and, unless there are rules or `always`, for CSV files whose header
/// has a column time_s; as import_csv, which keeps all frames, for others.
ImportedRecording read_or_import(const std::filesystem::path& file,
                                 std::span<const ColumnRule> rules, bool always,
                                 const ProgressCallback& done = {},
                                 std::size_t most_frames = all_frames);

}  // namespace stickslip::protocol
