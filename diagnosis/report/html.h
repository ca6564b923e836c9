// A diagnosis as one self-contained, printable page for readers outside the project: it loads
// nothing, runs no script, and states what is needed to reproduce it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/diagnosis.h"

namespace stickslip::report {

/// Origin of a diagnosis.
struct Provenance {
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

/// HTML that is also well-formed XML; the same diagnosis and provenance give the same bytes.
std::string report_html(const diagnosis::Diagnosis& diagnosis, const Provenance& provenance);

}  // namespace stickslip::report
