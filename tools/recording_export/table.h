// SPDX-License-Identifier: Apache-2.0
// A recording as tables of columns, for export to other programs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "protocol/recording.h"

namespace stickslip::recording_export {

/// One column. Missing values are NaN.
struct Column {
  std::string name;
  std::string unit;     ///< "1" for dimensionless numbers and counts
  std::string meaning;  ///< short description
  std::variant<std::vector<double>, std::vector<std::int64_t>, std::vector<std::uint8_t>> values;

  std::size_t rows() const;
};

struct Table {
  std::string name;     ///< "frames", "excitation", "estimate"
  std::string meaning;  ///< of a row
  std::vector<Column> columns;

  std::size_t rows() const { return columns.empty() ? 0 : columns.front().rows(); }
  /// The column of that name, or null.
  const Column* find(const std::string& name) const;
};

/// A recording with its description.
struct Tables {
  std::string source;
  std::string written_by = {};  ///< the command that exports them
  protocol::Description description;
  std::string cut_off_warning = {};  ///< of a truncated recording; otherwise empty
  std::string time_steps = {};       ///< a line for each step of the time that is no lost frame
  std::vector<Table> tables;         ///< frames, then other tables that have rows

  const Table* find(const std::string& name) const;
};

/// Reads a recording, and from a log also the commanded excitation and the estimates of the
/// observer. `done` receives the progress. Throws InputError as protocol::read_recording does.
Tables tables_of(const std::filesystem::path& recording,
                 const protocol::ProgressCallback& done = {});

/// The description as pairs of name and text, in the same order for all formats.
std::vector<std::pair<std::string, std::string>> description_texts(const Tables& tables);

}  // namespace stickslip::recording_export
