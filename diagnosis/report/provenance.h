// SPDX-License-Identifier: Apache-2.0
// Origin of a diagnosis, as its reports state it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace stickslip::report {

struct Provenance {
  /// With the names of files only and without outputs: the same input gives the same report,
  /// wherever it lies and is written to.
  std::string command;
  std::string version;
  std::uint64_t seed = 0;
  /// The recordings in the order of the diagnosis, the model, and the campaign if there is one.
  struct File {
    std::string name;
    std::string sha256;
  };
  std::vector<File> files;
  std::optional<File> candidates = {};  ///< hypotheses beside the catalogue
  std::string built_with = {};          ///< compiler and libraries that results may depend on
  std::string augmented_model = {};     ///< the resulting model file; empty: not shown
};

/// Of a diagnosis, or of another command on recordings and a model, with the default options.
Provenance provenance_of(const std::vector<Provenance::File>& recordings,
                         const Provenance::File& model, std::uint64_t seed,
                         const std::string& command = "diagnose");

/// Appends these options to the command, as numbers that read back the same, where they are not the
/// defaults.
void add_horizon(Provenance& provenance, std::optional<double> horizon_s);
void add_false_alarm_rate(Provenance& provenance, double rate);

}  // namespace stickslip::report
