// SPDX-License-Identifier: Apache-2.0
// Mapping files of the importer: what the columns of a foreign CSV file are.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace stickslip::config {

/// One line of a mapping file: "Weg [mm]" = { channel = "displacement", unit = "mm", factor = 2.0,
/// sign = -1 }, or "Weg [mm]" = "displacement".
struct MappedColumn {
  std::string column;
  std::optional<std::string> channel;
  std::optional<std::string> unit;
  double factor = 1.0;  ///< sign included
};

/// Throws InputError with file and line for an unknown key or a value of the wrong type.
std::vector<MappedColumn> load_import_map(const std::filesystem::path& file);

}  // namespace stickslip::config
