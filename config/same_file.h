// SPDX-License-Identifier: Apache-2.0
// Whether two paths lead to one file.
#pragma once

#include <filesystem>

namespace stickslip::config {

/// The file at the end of a path.
struct LinkEnd {
  std::filesystem::path path;       ///< the final target of symbolic links, also if it is missing
  bool through_descriptor = false;  ///< by the descriptors of a process, as /dev/stdout does
};

LinkEnd end_of_links(const std::filesystem::path& name);

/// True if both paths lead to the same file or folder: by links of either kind, or by another
/// spelling. Of files that do not exist, the places where they would be created are compared.
/// Devices and pipes are not files in this sense.
bool is_same_file(const std::filesystem::path& one, const std::filesystem::path& other);

}  // namespace stickslip::config
