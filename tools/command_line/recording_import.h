// SPDX-License-Identifier: Apache-2.0
// Options of the importer of foreign CSV files, and recordings read with them.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "protocol/recording.h"

namespace stickslip::command_line {

struct ImportOptions {
  std::string map;                 ///< mapping file; empty: none
  std::vector<std::string> units;  ///< "COLUMN=mm"
};

/// Adds --map and --unit.
void add_import_options(CLI::App& command, ImportOptions& options);

/// As recording_from, for CSV files of other programs too; what was guessed is printed on standard
/// error. `always`: the file is not read strictly even if it has a column time_s.
protocol::Recording recording_from(const std::filesystem::path& file, const ImportOptions& options,
                                   bool always = false,
                                   std::size_t most_frames = protocol::all_frames);

}  // namespace stickslip::command_line
