// Writing a whole file, or saying why not.
#pragma once

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
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

/// Throws InputError where `path` (unless empty) cannot be opened for writing: before the work
/// whose result shall go there. Changes no file, and leaves none behind.
inline void expect_writable(const std::string& path) {
  if (path.empty()) return;
  const bool there = std::filesystem::exists(path);
  const bool opened = std::ofstream(path, std::ios::binary | std::ios::app).is_open();
  const int error = errno;
  if (!opened) {
    throw InputError(
        Problem{path, 0, 0, std::string("cannot be written: ") + std::strerror(error)});
  }
  if (!there) std::filesystem::remove(path);
}

/// Throws InputError where the file cannot be opened for writing, and std::runtime_error where it
/// cannot hold all of the content.
inline void write_file(const std::string& path, const std::string& content) {
  std::ofstream file(path, std::ios::binary);
  if (!file) {
    throw InputError(
        Problem{path, 0, 0, std::string("cannot be written: ") + std::strerror(errno)});
  }
  file << content;
  file.close();
  if (!file) {
    throw std::runtime_error(path + ": is not complete: " + std::strerror(errno));
  }
}

/// The same, but "-" is standard output, which main() looks at in the end.
inline void write_table(const std::string& file, const std::string& text) {
  if (file == "-") {
    std::fwrite(text.data(), 1, text.size(), stdout);
  } else {
    write_file(file, text);
  }
}

}  // namespace stickslip::tools
