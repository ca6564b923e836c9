// Writing a whole file, or saying why not.
#pragma once

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "physics/problem.h"

namespace stickslip::tools {

/// Makes the folder, and those above it, unless it is there. Throws InputError where it cannot be.
inline void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error || !std::filesystem::is_directory(folder)) {
    throw InputError(
        Problem{folder.string(), 0, 0,
                "is no folder and cannot be made one: " +
                    (error ? error.message() : std::string("something else bears the name"))});
  }
}

/// Throws InputError where the file cannot be written.
inline void write_file(const std::string& path, const std::string& content) {
  std::ofstream file(path, std::ios::binary);
  file << content;
  file.close();
  if (!file) {
    throw InputError(
        Problem{path, 0, 0, std::string("cannot be written: ") + std::strerror(errno)});
  }
}

}  // namespace stickslip::tools
