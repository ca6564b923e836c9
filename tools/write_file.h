// Writing a whole file, or saying why not.
#pragma once

#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>

#include "physics/problem.h"

namespace stickslip::tools {

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
