// SPDX-License-Identifier: Apache-2.0
#include "observer/transition.h"

namespace stickslip::observer {

Matrix Transition::dense() const {
  Matrix sums = Matrix::Zero(shared_, count_);
  Matrix out = Matrix::Zero(count_, count_);
  const auto fill = [&](Matrix& matrix, int row, const Entry* entry, const Entry* end) {
    for (; entry != end; ++entry) {
      const int from = static_cast<int>(entry->from);
      if (from < count_) {
        matrix(row, from) += entry->weight;
      } else {
        matrix.row(row) += entry->weight * sums.row(from - padded(count_));
      }
    }
  };
  for (int i = 0; i < shared_; ++i) fill(sums, i, shared_begin(i), shared_end(i));
  for (int i = 0; i < count_; ++i) fill(out, i, row_begin(i), row_end(i));
  return out;
}

}  // namespace stickslip::observer
