#include "observer/covariance.h"

#include <algorithm>
#include <utility>

namespace stickslip::observer {

namespace {

// Four doubles in a register; whole expressions of them become fused instructions where there are
// some (CMakeLists.txt allows contraction for this file).
constexpr int lanes = 4;
static_assert(padded(1) == lanes);
using Lanes = double __attribute__((vector_size(lanes * sizeof(double)), may_alias));

Lanes* lanes_of(double* row) { return reinterpret_cast<Lanes*>(row); }
const Lanes* lanes_of(const double* row) { return reinterpret_cast<const Lanes*>(row); }

/// Some rows of a transition, one after the other: row i has the entries from end[i - 1] to end[i].
struct Rows {
  const Transition::Entry* entry;
  const int* end;
  int begun;  ///< where the first row begins
  int count;
};

// Each row of out, `width` apart, is the sum of weight times row of `from`, over the first `blocks`
// registers.
template <int blocks>
void weighted_rows(const Rows& rows, const double* from, double* out, int width) {
  int at = rows.begun;
  for (int row = 0; row < rows.count; ++row, out += width) {
    Lanes sum[blocks] = {};  // an array of the library loses the alignment
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
// By the number of registers less 1.
constexpr auto weighted = table(std::make_integer_sequence<int, 12>{});

WeightedRows weighted_for(int columns) {
  return weighted[static_cast<std::size_t>((columns - 1) / lanes)];
}

Rows rows_of(const Transition& f, int first, int count) {
  return {f.entries(), f.row_ends(first), f.row_start(first), count};
}

// Transposes a square of four by four.
void turn(const double* from, double* to, int width) {
  Lanes row[lanes];
  for (int i = 0; i < lanes; ++i) row[i] = lanes_of(from + i * width)[0];
  const Lanes low01 = __builtin_shufflevector(row[0], row[1], 0, 4, 2, 6);
  const Lanes high01 = __builtin_shufflevector(row[0], row[1], 1, 5, 3, 7);
  const Lanes low23 = __builtin_shufflevector(row[2], row[3], 0, 4, 2, 6);
  const Lanes high23 = __builtin_shufflevector(row[2], row[3], 1, 5, 3, 7);
  lanes_of(to)[0] = __builtin_shufflevector(low01, low23, 0, 1, 4, 5);
  lanes_of(to + width)[0] = __builtin_shufflevector(high01, high23, 0, 1, 4, 5);
  lanes_of(to + 2 * width)[0] = __builtin_shufflevector(low01, low23, 2, 3, 6, 7);
  lanes_of(to + 3 * width)[0] = __builtin_shufflevector(high01, high23, 2, 3, 6, 7);
}

}  // namespace

Covariance::Covariance(int count) : count_(count), width_(padded(count)) {}

void Covariance::propagate(const Transition& f) {
  const auto at = [this](auto& rows, int row) {
    return rows.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(width_);
  };
  const WeightedRows whole = weighted_for(width_);
  // Sums may use those before them: they are rows behind the states'.
  const auto share = [&](double* rows) {
    whole(rows_of(f, -f.shared(), f.shared()), rows, rows + width_ * width_, width_);
  };
  mirror();
  share(states_.data());
  whole(rows_of(f, 0, count_), states_.data(), half_.data(), width_);
  for (int i = 0; i < width_; i += lanes) {
    for (int j = 0; j < width_; j += lanes) turn(at(half_, i) + j, at(turned_, j) + i, width_);
  }
  share(turned_.data());
  // The lower triangle is enough.
  for (int i = 0; i < count_; i += lanes) {
    weighted_for(i + 1)(rows_of(f, i, std::min(lanes, count_ - i)), turned_.data(), at(states_, i),
                        width_);
  }
}

void Covariance::column(int state, States& out) const {
  for (int i = 0; i <= state; ++i) out[i] = states_[place(state, 0) + static_cast<std::size_t>(i)];
  const double* below = states_.data() + static_cast<std::size_t>(state);
  for (int i = state + 1; i < count_; ++i) out[i] = below[i * width_];
}

void Covariance::correct(const States& gain, const States& column, double expected) {
  // (I - K H) P (I - K H)' + K r K' = P - K p' - (p - K s) K' with p = P H', s = H P H' + r.
  Lanes rest[most / lanes];
  for (int j = 0; j < width_ / lanes; ++j) {
    rest[j] = lanes_of(column.of.data())[j] - expected * lanes_of(gain.of.data())[j];
  }
  // Four rows at a time, for which gain and rest are fetched once.
  for (int i = 0; i < width_; i += lanes) {
    Lanes* first = lanes_of(states_.data() + place(i, 0));
    const int stride = width_ / lanes;
    const double p0 = column[i], p1 = column[i + 1], p2 = column[i + 2], p3 = column[i + 3];
    const double k0 = gain[i], k1 = gain[i + 1], k2 = gain[i + 2], k3 = gain[i + 3];
    for (int j = 0; j <= i / lanes; ++j) {
      const Lanes g = lanes_of(gain.of.data())[j];
      const Lanes r = rest[j];
      first[j] -= p0 * g + k0 * r;
      first[j + stride] -= p1 * g + k1 * r;
      first[j + 2 * stride] -= p2 * g + k2 * r;
      first[j + 3 * stride] -= p3 * g + k3 * r;
    }
  }
}

// The upper triangle after the lower one.
void Covariance::mirror() {
  const auto at = [this](int row, int column) {
    return states_.data() + static_cast<std::size_t>(row * width_ + column);
  };
  for (int i = 0; i < width_; i += lanes) {
    for (int j = 0; j < i; j += lanes) turn(at(i, j), at(j, i), width_);
    for (int k = i; k < i + lanes; ++k) {
      for (int l = k + 1; l < i + lanes; ++l) *at(k, l) = *at(l, k);
    }
  }
}

}  // namespace stickslip::observer
