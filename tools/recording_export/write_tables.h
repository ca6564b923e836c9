// SPDX-License-Identifier: Apache-2.0
// Tables of a recording written as files of other programs.
#pragma once

#include <filesystem>

#include "tools/recording_export/table.h"

namespace stickslip::recording_export {

/// Writes the format given by the extension of `out`: .csv, .mat (MATLAB 5), .h5 or .hdf5. Throws
/// InputError if the extension is unknown, the file cannot be written, or a limit of the format is
/// exceeded.
void write_tables(const Tables& tables, const std::filesystem::path& out,
                  const protocol::ProgressCallback& done = {});

void write_tables_csv(const Tables& tables, const std::filesystem::path& out,
                      const protocol::ProgressCallback& done = {});
void write_tables_mat(const Tables& tables, const std::filesystem::path& out);
void write_tables_hdf5(const Tables& tables, const std::filesystem::path& out);

}  // namespace stickslip::recording_export
