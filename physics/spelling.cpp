// SPDX-License-Identifier: Apache-2.0
#include "physics/spelling.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

namespace stickslip::physics {

namespace {

/// Damerau-Levenshtein distance: insertions, deletions, changes and swaps of neighbours.
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1);
  std::vector<std::size_t> above(b.size() + 1);
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(above.begin(), above.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] =
          std::min({above[j] + 1, row[j - 1] + 1, above[j - 1] + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        row[j] = std::min(row[j], before[j - 2] + 1);
      }
    }
    std::swap(before, above);
    std::swap(above, row);
  }
  return above[b.size()];
}

}  // namespace

std::string nearest(std::string_view name, const std::vector<std::string>& names) {
  constexpr std::size_t longest_name = 64;
  if (name.size() > longest_name) return {};
  // A name without its unit.
  for (const std::string& each : names) {
    if (name.size() >= 2 && each.starts_with(std::string(name) + '_')) return each;
  }
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, name.size() / 3) + 1;
  for (const std::string& each : names) {
    const std::size_t d = distance(name, each);
    if (d < best_distance && d < each.size()) {
      best = each;
      best_distance = d;
    }
  }
  // A name with another unit, or none.
  if (best.empty() && name.size() >= 3) {
    for (const std::string& each : names) {
      if (each.starts_with(name) || name.starts_with(each)) return each;
    }
  }
  return best;
}

}  // namespace stickslip::physics
