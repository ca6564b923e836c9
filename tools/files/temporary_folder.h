// SPDX-License-Identifier: Apache-2.0
// A folder for files in progress, removed with its content at the end.
#pragma once

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <system_error>

#include "physics/failure.h"

namespace stickslip::files {

class TemporaryFolder {
 public:
  /// Throws Failure if the system has no place for it.
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "stickslip-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) {
      throw Failure(name + ": cannot be created: " + std::strerror(errno));
    }
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace stickslip::files
