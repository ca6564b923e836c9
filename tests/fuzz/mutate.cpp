// SPDX-License-Identifier: Apache-2.0
// Replacement of libFuzzer without clang: mutates seeds in a fixed order and passes them to the
// target.
//   fuzz_NAME [--rounds N] SEED...     SEED: a file, or a folder of files
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes content(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

std::vector<Bytes> seeds_of(const std::vector<std::filesystem::path>& paths) {
  std::vector<std::filesystem::path> files;
  for (const auto& path : paths) {
    if (std::filesystem::is_directory(path)) {
      for (const auto& entry : std::filesystem::directory_iterator(path)) files.push_back(entry);
    } else {
      files.push_back(path);
    }
  }
  std::sort(files.begin(), files.end());  // folders are unordered
  std::vector<Bytes> out;
  for (const auto& file : files) out.push_back(content(file));
  return out;
}

// Boundary values of sizes, counts and digits.
constexpr std::uint8_t boundary[] = {0,   1,   0x7F, 0x80, 0xFF, '0', '9',
                                     '-', '.', ',',  '\n', 'e',  '#'};

void corrupt(Bytes& bytes, const std::vector<Bytes>& seeds, std::mt19937& random) {
  const auto below = [&random](std::size_t n) { return n == 0 ? 0 : random() % n; };
  const auto at = [&](const Bytes& some) {
    return some.begin() + static_cast<std::ptrdiff_t>(below(some.size() + 1));
  };
  switch (below(7)) {
    case 0:
      if (!bytes.empty()) bytes[below(bytes.size())] ^= static_cast<std::uint8_t>(1U << below(8));
      break;
    case 1:
      if (!bytes.empty()) bytes[below(bytes.size())] = boundary[below(std::size(boundary))];
      break;
    case 2:
      bytes.insert(at(bytes), boundary[below(std::size(boundary))]);
      break;
    case 3:  // four equal bytes in a row: a length, a count
      for (std::size_t i = below(bytes.size()), n = 4; n > 0 && i < bytes.size(); --n, ++i) {
        bytes[i] = n == 4 ? boundary[below(5)] : boundary[4 * below(2)];
      }
      break;
    case 4:
      bytes.resize(below(bytes.size() + 1));
      break;
    case 5: {  // a part removed
      const std::size_t from = below(bytes.size());
      const std::size_t to = std::min(bytes.size(), from + below(64));
      bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(from),
                  bytes.begin() + static_cast<std::ptrdiff_t>(to));
      break;
    }
    default: {  // a part of another seed inserted
      const Bytes& other = seeds[below(seeds.size())];
      const std::size_t from = below(other.size());
      const std::size_t to = std::min(other.size(), from + below(200));
      bytes.insert(at(bytes), other.begin() + static_cast<std::ptrdiff_t>(from),
                   other.begin() + static_cast<std::ptrdiff_t>(to));
    }
  }
}

int run(int argc, char** argv) {
  long rounds = 1000;
  std::vector<std::filesystem::path> paths;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--rounds" && i + 1 < argc) {
      rounds = std::strtol(argv[++i], nullptr, 10);
    } else {
      paths.emplace_back(argv[i]);
    }
  }
  const std::vector<Bytes> seeds = seeds_of(paths);
  if (seeds.empty()) {
    std::fprintf(stderr, "no seeds given\n");
    return 2;
  }
  for (const Bytes& seed : seeds) LLVMFuzzerTestOneInput(seed.data(), seed.size());
  for (long round = 0; round < rounds; ++round) {
    // A generator per round, so that a single round can be repeated.
    std::mt19937 random(static_cast<std::mt19937::result_type>(round));
    Bytes bytes = seeds[random() % seeds.size()];
    for (std::size_t n = 1 + random() % 4; n > 0; --n) corrupt(bytes, seeds, random);
    try {
      LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
    } catch (const std::exception& error) {
      std::fprintf(stderr, "round %ld: %s\n", round, error.what());
      return 1;
    }
  }
  std::printf("%ld rounds over %zu seeds\n", rounds, seeds.size());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
