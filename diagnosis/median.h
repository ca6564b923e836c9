// The value in the middle.
#pragma once

#include <algorithm>
#include <vector>

namespace stickslip::diagnosis {

/// The upper of the two in the middle where there are as many above as below; at least one value.
inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace stickslip::diagnosis
