// SPDX-License-Identifier: Apache-2.0
// The files of a configuration: those that it is read from, and those that it has written. A file
// is read unless the entry of its key says that it is written (key.h).
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace stickslip::config {

struct Rig;

/// A file that a configuration names.
struct NamedFile {
  std::string key;  ///< "rig.model"; empty for the configuration itself
  std::filesystem::path file;
  bool written = false;
};

/// A rig's configuration, and the files that it names.
std::vector<NamedFile> named_files(const Rig& rig);

/// Files that a configuration names in order to read them: those of a rig, even one with errors,
/// and those of a campaign. A file of any other kind names none; pipes and devices are not opened.
/// Does not throw.
std::vector<std::filesystem::path> files_read_with(const std::filesystem::path& file);

/// Why a rig must not write `file` for the key `key`: the configuration or another of its keys uses
/// that file. Empty if it may.
std::string wrong_with_output(const Rig& rig, std::string_view key,
                              const std::filesystem::path& file);

}  // namespace stickslip::config
