#include "diagnosis/report/provenance.h"

#include <fstream>
#include <iterator>

#include "protocol/sha256.h"

namespace stickslip::report {

namespace {

Provenance::File checked(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  const std::string content{std::istreambuf_iterator<char>(in), {}};
  return {path.filename().string(), protocol::sha256_of(content)};
}

}  // namespace

Provenance provenance_of(const std::vector<std::filesystem::path>& recordings,
                         const std::filesystem::path& model, std::uint64_t seed) {
  Provenance out;
  out.command = "stickslip diagnose";
  for (const std::filesystem::path& recording : recordings) {
    out.files.push_back(checked(recording));
    out.command += " " + out.files.back().name;
  }
  out.files.push_back(checked(model));
  out.command += " --model " + out.files.back().name + " --seed " + std::to_string(seed);
  out.version = STICKSLIP_VERSION;
  out.seed = seed;
  out.built_with = std::string("g++ ") + __VERSION__;
  return out;
}

}  // namespace stickslip::report
