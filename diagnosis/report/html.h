// A diagnosis as one self-contained page for a person who has never seen the project: nothing is
// loaded from elsewhere, nothing runs, it prints, and it holds what is needed to repeat it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/diagnosis.h"

namespace stickslip::diagnosis {

/// Where a diagnosis came from.
struct Provenance {
  std::string command;
  std::string version;
  std::uint64_t seed = 0;
  /// The recordings in the order of the diagnosis, and then the model.
  struct File {
    std::string name;
    std::string sha256;
  };
  std::vector<File> files;
  std::string built_with = {};    ///< compiler and libraries that numbers may depend on
  std::string mended_model = {};  ///< the model that comes out, as a file; empty: not shown
};

/// The same diagnosis and provenance give the same bytes. The page is HTML that is also well-formed
/// XML.
std::string report_html(const Diagnosis& diagnosis, const Provenance& provenance);

}  // namespace stickslip::diagnosis
