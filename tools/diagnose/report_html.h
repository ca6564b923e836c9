// A diagnosis as one self-contained page: nothing is loaded from elsewhere, it prints, and it holds
// what is needed to repeat it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/diagnose/diagnosis.h"

namespace stickslip::diagnosis {

/// Where a diagnosis came from.
struct Provenance {
  std::string command;
  std::string version;
  std::uint64_t seed = 0;
  struct File {
    std::string name;
    std::string sha256;
  };
  std::vector<File> files;
};

/// The same diagnosis and provenance give the same bytes.
std::string report_html(const Diagnosis& diagnosis, const Provenance& provenance);

}  // namespace stickslip::diagnosis
