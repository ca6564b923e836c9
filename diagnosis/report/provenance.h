// Origin of a diagnosis, as its reports state it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace stickslip::report {

struct Provenance {
  /// With the names of files only and without outputs: the same input gives the same report,
  /// wherever it lies and is written to.
  std::string command;
  std::string version;
  std::uint64_t seed = 0;
  /// The recordings in the order of the diagnosis, then the model.
  struct File {
    std::string name;
    std::string sha256;
  };
  std::vector<File> files;
  std::string built_with = {};       ///< compiler and libraries that results may depend on
  std::string augmented_model = {};  ///< the resulting model file; empty: not shown
};

/// Of files that were read; outputs and options are left to the caller.
Provenance provenance_of(const std::vector<std::filesystem::path>& recordings,
                         const std::filesystem::path& model, std::uint64_t seed);

}  // namespace stickslip::report
