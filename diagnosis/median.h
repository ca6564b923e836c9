// SPDX-License-Identifier: Apache-2.0
// Median of a set of values.
#pragma once

#include <algorithm>
#include <vector>

namespace stickslip::diagnosis {

/// The upper of the two middle values of an even number; `values` must not be empty.
inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace stickslip::diagnosis
