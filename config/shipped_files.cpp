// SPDX-License-Identifier: Apache-2.0
#include "config/shipped_files.h"

#include <system_error>
#include <vector>

namespace stickslip::config {

namespace fs = std::filesystem;

fs::path shipped_folder() {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (error) return {};
  const fs::path folder = program.parent_path().parent_path() / "share/stickslip";
  return fs::is_directory(folder, error) ? folder : fs::path();
}

fs::path file_meant(const std::string& name, const std::string& folder, const fs::path& shipped) {
  std::error_code error;
  const fs::path asked(name);
  if (name.empty() || shipped.empty() || asked.is_absolute() || fs::exists(asked, error)) {
    return asked;
  }
  const std::string stem = name.starts_with("config/") ? name.substr(7) : name;
  std::vector<fs::path> folders = {shipped / folder, shipped};
  if (folder.empty()) {
    for (const char* each : {"models", "faults", "calibrations", "modbus"}) {
      folders.push_back(shipped / each);
    }
  }
  for (const fs::path& each : folders) {
    for (const std::string& file : {stem, stem + ".toml"}) {
      if (fs::is_regular_file(each / file, error)) return (each / file).lexically_normal();
    }
  }
  return asked;
}

}  // namespace stickslip::config
