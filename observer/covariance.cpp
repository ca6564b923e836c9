// SPDX-License-Identifier: Apache-2.0
#include "observer/covariance.h"

#include <algorithm>
#include <cstdint>
#include <utility>

namespace stickslip::observer {

namespace {

// Four doubles in a register. CMakeLists.txt allows contraction to fused multiply-add for this
// file.
constexpr int lanes = 4;
static_assert(padded(1) == lanes);
using Lanes = double __attribute__((vector_size(lanes * sizeof(double)), may_alias));

Lanes* lanes_of(double* row) { return reinterpret_cast<Lanes*>(row); }
const Lanes* lanes_of(const double* row) { return reinterpret_cast<const Lanes*>(row); }

/// Consecutive rows of a transition: row i has the entries from end[i - 1] to end[i].
struct Rows {
  const Transition::Entry* entry;
  const int* end;
  int begin;  ///< first entry of the first row
  int count;
};

// Sparse product: each row of `out` is a weighted sum of rows of `from`, over the first `blocks`
// registers; rows are `width` apart.
template <int blocks>
void weighted_rows(const Rows& rows, const double* from, double* out, int width) {
  int at = rows.begin;
  for (int row = 0; row < rows.count; ++row, out += width) {
    Lanes sum[blocks] = {};  // std::array would lose the alignment
    for (; at < rows.end[row]; ++at) {
      const Transition::Entry& entry = rows.entry[at];
      const Lanes* lanes = lanes_of(from + entry.place);
      const double weight = entry.weight;
#pragma GCC unroll 13
      for (int i = 0; i < blocks; ++i) sum[i] += weight * lanes[i];
    }
#pragma GCC unroll 13
    for (int i = 0; i < blocks; ++i) lanes_of(out)[i] = sum[i];
  }
}

using WeightedRows = void (*)(const Rows&, const double*, double*, int);

template <int... blocks>
constexpr std::array<WeightedRows, sizeof...(blocks)> table(
    std::integer_sequence<int, blocks...> /*counts*/) {
  return {weighted_rows<blocks + 1>...};
}
// Indexed by the number of registers minus 1: one group of parameters and all states.
constexpr int most_blocks = padded(max_states) / lanes + 1;
constexpr auto weighted = table(std::make_integer_sequence<int, most_blocks>{});

// The first `columns` of the rows.
void weighted_columns(const Rows& rows, const double* from, double* out, int width, int columns) {
  for (int first = 0; first < columns; first += lanes * most_blocks) {
    const int blocks = std::min(most_blocks, (columns - first + lanes - 1) / lanes);
    weighted[static_cast<std::size_t>(blocks - 1)](rows, from + first, out + first, width);
  }
}

Rows rows_of(const Transition& f, int first, int count) {
  return {f.entries(), f.row_ends(first), f.row_start(first), count};
}

struct Block {
  Lanes row[lanes];
};

// The transpose of a 4 x 4 block of rows `width` apart.
Block transposed(const double* from, int width) {
  Lanes row[lanes];
  for (int i = 0; i < lanes; ++i) row[i] = lanes_of(from + i * width)[0];
  const Lanes low01 = __builtin_shufflevector(row[0], row[1], 0, 4, 2, 6);
  const Lanes high01 = __builtin_shufflevector(row[0], row[1], 1, 5, 3, 7);
  const Lanes low23 = __builtin_shufflevector(row[2], row[3], 0, 4, 2, 6);
  const Lanes high23 = __builtin_shufflevector(row[2], row[3], 1, 5, 3, 7);
  return {{__builtin_shufflevector(low01, low23, 0, 1, 4, 5),
           __builtin_shufflevector(high01, high23, 0, 1, 4, 5),
           __builtin_shufflevector(low01, low23, 2, 3, 6, 7),
           __builtin_shufflevector(high01, high23, 2, 3, 6, 7)}};
}

void transpose(const double* from, double* to, int width) {
  const Block block = transposed(from, width);
  for (int i = 0; i < lanes; ++i) lanes_of(to + i * width)[0] = block.row[i];
}

// The first columns of some rows.
void copy_columns(const double* from, int from_width, double* to, int to_width, int columns,
                  int rows) {
  for (int first = 0; first < columns; first += lanes) {
    for (int k = 0; k < rows; ++k) {
      *lanes_of(to + k * to_width + first) = *lanes_of(from + k * from_width + first);
    }
  }
}

}  // namespace

Covariance::Covariance(int count, int parameters)
    : count_(count), offset_(padded(parameters)), width_(offset_ + padded(count)) {
  const int rows = padded(count) + max_shared_sums;
  rows_ = Storage(rows * width_);
  transposed_ = Storage(rows * width_);
  sensitivities_ = Storage(rows * offset_);
  product_ = Storage(lanes * width_);
}

// The shared sums, each of which may use previous ones, are rows after the states'.
void Covariance::add_shared(const Transition& f, double* rows) const {
  weighted_columns(rows_of(f, -f.shared(), f.shared()), rows, rows + padded(count_) * width_,
                   width_, width_);
}

// Only those elements of F P are found that a product with F' takes to the upper triangle: of row
// i, the columns that F has in its rows up to i. Chains follow the core, which does not depend on
// them, so these are few.
void Covariance::multiply_from_left(const Transition& f) {
  int columns = 1;
  for (int i = 0; i < count_; i += lanes) {
    const int rows = std::min(lanes, count_ - i);
    for (int row = i; row < i + rows; ++row) columns = std::max(columns, f.columns(row));
    double* product = product_.data();
    if (rows < lanes) product_.fill(0.0);
    weighted_columns(rows_of(f, i, rows), rows_.data(), product, width_, offset_ + columns);
    copy_columns(product, width_, sensitivities_.data() + i * offset_, offset_, offset_, lanes);
    double* to = transposed_.data() + i;
    for (int j = 0; j < columns; j += lanes) {
      transpose(product + offset_ + j, to + j * width_, width_);
    }
  }
}

void Covariance::propagate(const Transition& f) {
  mirror();
  add_shared(f, rows_.data());
  multiply_from_left(f);
  add_shared(f, transposed_.data());
  for (int i = 0; i < count_; i += lanes) {
    const Rows rows = rows_of(f, i, std::min(lanes, count_ - i));
    weighted_columns(rows, transposed_.data() + i, row(i) + offset_ + i, width_,
                     padded(count_) - i);
  }
  copy_columns(sensitivities_.data(), offset_, rows_.data(), width_, offset_, count_);
}

void Covariance::column(int state, States& out) const {
  const double* above = rows_.data() + offset_ + state;
  for (int i = 0; i < state; ++i) out[i] = above[i * width_];
  const double* from = row(state) + offset_;
  for (int i = state; i < count_; ++i) out[i] = from[i];
}

void Covariance::optimal_gain(const States& column, std::span<const ParameterLanes> error,
                              double innovation_variance, States& gain) const {
  const double weight = 1.0 / innovation_variance;
  const double* first = rows_.data();
  for (int i = 0; i < count_; i += lanes) {
    Lanes sum = *lanes_of(column.of.data() + i);
    for (std::size_t g = 0; g < error.size(); ++g) {
      const Block by = transposed(first + i * width_ + lanes * static_cast<int>(g), width_);
      sum += error[g][0] * by.row[0] + error[g][1] * by.row[1] +
             (error[g][2] * by.row[2] + error[g][3] * by.row[3]);
    }
    *lanes_of(gain.of.data() + i) = weight * sum;
  }
}

void Covariance::correct(const States& gain, const States& column, double innovation_variance,
                         std::span<const ParameterLanes> error) {
  // (I - K H) P (I - K H)' + K r K' = P - K p' - (p - K s) K' with p = P H', s = H P H' + r.
  const int blocks = (width_ - offset_) / lanes;
  const Lanes* gains = lanes_of(gain.of.data());
  Lanes rest[most / lanes];
  for (int j = 0; j < blocks; ++j) {
    rest[j] = lanes_of(column.of.data())[j] - innovation_variance * gains[j];
  }
  // Four rows at a time share the loads of gain and rest.
  const int stride = width_ / lanes;
  for (int i = 0; i < blocks; ++i) {
    const int at = lanes * i;
    const double p0 = column[at], p1 = column[at + 1], p2 = column[at + 2], p3 = column[at + 3];
    const double k0 = gain[at], k1 = gain[at + 1], k2 = gain[at + 2], k3 = gain[at + 3];
    Lanes* first = lanes_of(row(at));
    for (const ParameterLanes& each : error) {
      const Lanes e = {each[0], each[1], each[2], each[3]};
      first[0] -= k0 * e;
      first[stride] -= k1 * e;
      first[2 * stride] -= k2 * e;
      first[3 * stride] -= k3 * e;
      ++first;
    }
    first = lanes_of(row(at) + offset_);
    for (int j = i; j < blocks; ++j) {
      const Lanes g = gains[j];
      const Lanes r = rest[j];
      first[j] = first[j] - p0 * g - k0 * r;
      first[j + stride] = first[j + stride] - p1 * g - k1 * r;
      first[j + 2 * stride] = first[j + 2 * stride] - p2 * g - k2 * r;
      first[j + 3 * stride] = first[j + 3 * stride] - p3 * g - k3 * r;
    }
  }
}

// Copies the upper triangle to the lower one.
void Covariance::mirror() {
  const auto at = [this](int i, int column) { return row(i) + offset_ + column; };
  const int end = padded(count_);
  for (int i = 0; i < end; i += lanes) {
    for (int j = i + lanes; j < end; j += lanes) transpose(at(i, j), at(j, i), width_);
    // Below the diagonal the transpose, from it on what is there.
    const Block below = transposed(at(i, i), width_);
    Lanes* row = lanes_of(at(i + 1, i));
    *row = __builtin_shufflevector(below.row[1], *row, 0, 5, 6, 7);
    row = lanes_of(at(i + 2, i));
    *row = __builtin_shufflevector(below.row[2], *row, 0, 1, 6, 7);
    row = lanes_of(at(i + 3, i));
    *row = __builtin_shufflevector(below.row[3], *row, 0, 1, 2, 7);
  }
}

}  // namespace stickslip::observer
