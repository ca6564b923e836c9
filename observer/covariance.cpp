#include "observer/covariance.h"

#include <algorithm>
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

// Sparse product: each row of `out`, `width` apart, is a weighted sum of rows of `from`, over the
// first `blocks` registers.
template <int blocks>
void weighted_rows(const Rows& rows, const double* from, double* out, int width) {
  int at = rows.begin;
  for (int row = 0; row < rows.count; ++row, out += width) {
    Lanes sum[blocks] = {};  // std::array would lose the alignment
    for (; at < rows.end[row]; ++at) {
      const Transition::Entry& entry = rows.entry[at];
      const Lanes* lanes = lanes_of(from + entry.place);
      const double weight = entry.weight;
#pragma GCC unroll 12
      for (int i = 0; i < blocks; ++i) sum[i] += weight * lanes[i];
    }
#pragma GCC unroll 12
    for (int i = 0; i < blocks; ++i) lanes_of(out)[i] = sum[i];
  }
}

using WeightedRows = void (*)(const Rows&, const double*, double*, int);

template <int... blocks>
constexpr std::array<WeightedRows, sizeof...(blocks)> table(
    std::integer_sequence<int, blocks...> /*counts*/) {
  return {weighted_rows<blocks + 1>...};
}
// Indexed by the number of registers minus 1.
constexpr auto weighted = table(std::make_integer_sequence<int, 12>{});

WeightedRows weighted_for(int columns) {
  return weighted[static_cast<std::size_t>((columns - 1) / lanes)];
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

}  // namespace

Covariance::Covariance(int count) : count_(count), width_(padded(count)) {}

// Only those elements of F P are found that a product with F' takes to the upper triangle: of row
// i, the columns that F has in its rows up to i. Chains follow the core, which does not depend on
// them, so these are few.
void Covariance::propagate(const Transition& f) {
  const auto at = [this](auto& rows, int row) {
    return rows.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(width_);
  };
  // The shared sums, each of which may use previous ones, are rows after the states'.
  const auto add_shared = [&](double* rows) {
    weighted_for(width_)(rows_of(f, -f.shared(), f.shared()), rows, rows + width_ * width_, width_);
  };
  mirror();
  add_shared(states_.data());
  int columns = 1;
  for (int i = 0; i < count_; i += lanes) {
    const int rows = std::min(lanes, count_ - i);
    for (int row = i; row < i + rows; ++row) columns = std::max(columns, f.columns(row));
    if (rows < lanes) product_.fill(0.0);
    weighted_for(columns)(rows_of(f, i, rows), states_.data(), product_.data(), width_);
    for (int j = 0; j < columns; j += lanes) {
      transpose(product_.data() + j, at(transposed_, j) + i, width_);
    }
  }
  add_shared(transposed_.data());
  for (int i = 0; i < count_; i += lanes) {
    weighted_for(width_ - i)(rows_of(f, i, std::min(lanes, count_ - i)), transposed_.data() + i,
                             at(states_, i) + i, width_);
  }
}

void Covariance::column(int state, States& out) const {
  const double* above = states_.data() + state;
  for (int i = 0; i < state; ++i) out[i] = above[i * width_];
  const double* row = states_.data() + state * width_;
  for (int i = state; i < count_; ++i) out[i] = row[i];
}

void Covariance::correct(const States& gain, const States& column, double innovation_variance) {
  // (I - K H) P (I - K H)' + K r K' = P - K p' - (p - K s) K' with p = P H', s = H P H' + r.
  Lanes rest[most / lanes];
  for (int j = 0; j < width_ / lanes; ++j) {
    rest[j] = lanes_of(column.of.data())[j] - innovation_variance * lanes_of(gain.of.data())[j];
  }
  // Four rows at a time share the loads of gain and rest.
  for (int i = 0; i < width_; i += lanes) {
    Lanes* first = lanes_of(states_.data() + i * width_);
    const int stride = width_ / lanes;
    const double p0 = column[i], p1 = column[i + 1], p2 = column[i + 2], p3 = column[i + 3];
    const double k0 = gain[i], k1 = gain[i + 1], k2 = gain[i + 2], k3 = gain[i + 3];
    for (int j = i / lanes; j < stride; ++j) {
      const Lanes g = lanes_of(gain.of.data())[j];
      const Lanes r = rest[j];
      first[j] -= p0 * g + k0 * r;
      first[j + stride] -= p1 * g + k1 * r;
      first[j + 2 * stride] -= p2 * g + k2 * r;
      first[j + 3 * stride] -= p3 * g + k3 * r;
    }
  }
}

// Copies the upper triangle to the lower one.
void Covariance::mirror() {
  const auto at = [this](int row, int column) { return states_.data() + row * width_ + column; };
  for (int i = 0; i < width_; i += lanes) {
    for (int j = i + lanes; j < width_; j += lanes) transpose(at(i, j), at(j, i), width_);
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
