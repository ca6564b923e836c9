// SPDX-License-Identifier: Apache-2.0
// Jacobian of one period in sparse form: every state is a weighted sum of the previous states and
// of a few shared sums, such as the contact force, which several rows use.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "observer/layout.h"

namespace stickslip::observer {

inline constexpr int max_shared_sums = 4;

/// Number of states, rounded up to whole registers of four.
constexpr int padded(int count) { return (count + 3) / 4 * 4; }

class Transition {
 public:
  struct Entry {
    double weight = 0.0;
    std::uint32_t from = 0;   ///< a state, or padded(count()) + i for the shared sum i
    std::uint32_t place = 0;  ///< offset of that row in rows of width() values
  };

  /// For `count` states; no rows yet.
  explicit Transition(int count) : count_(count), width_(padded(count)) {}

  int count() const { return count_; }
  /// Width of the rows that it is to be multiplied with; at first padded(count()).
  int width() const { return width_; }
  void set_width(int width) {
    width_ = width;
    for (Entry& entry : entry_) entry.place = entry.from * static_cast<std::uint32_t>(width);
  }
  int shared() const { return shared_; }

  /// Removes all rows. To be followed by the shared sums in order, each of which may use previous
  /// ones, and the rows of all states in order; each is a begin_ and its add()s.
  void clear() { entries_ = rows_ = shared_ = 0; }
  void begin_shared() {
    ++shared_;
    begin_row();
  }
  void begin_row() {
    first_[static_cast<std::size_t>(rows_)] = entries_;
    columns_[static_cast<std::size_t>(rows_)] = 0;
    ++rows_;
    first_[static_cast<std::size_t>(rows_)] = entries_;
  }
  /// Adds weight times a state, or times a shared sum, to the current row; returns the position
  /// for at().
  int add(int from, double weight) {
    const auto row = static_cast<std::uint32_t>(from);
    entry_[static_cast<std::size_t>(entries_)] = {weight, row,
                                                  row * static_cast<std::uint32_t>(width_)};
    ++entries_;
    first_[static_cast<std::size_t>(rows_)] = entries_;
    int& columns = columns_[static_cast<std::size_t>(rows_ - 1)];
    const int sum = from - padded(count_);
    columns = std::max(columns, sum < 0 ? from + 1 : columns_[static_cast<std::size_t>(sum)]);
    return entries_ - 1;
  }
  int add_shared(int sum, double weight) { return add(padded(count_) + sum, weight); }

  /// Removes the rows from that of `state` on, to be added again.
  void clear_from(int state) {
    rows_ = shared_ + state;
    entries_ = first_[static_cast<std::size_t>(rows_)];
  }

  /// Weight at a position, to be changed in place.
  double& at(int place) { return entry_[static_cast<std::size_t>(place)].weight; }

  const Entry& entry(int place) const { return entry_[static_cast<std::size_t>(place)]; }

  const Entry* shared_begin(int sum) const { return begin(sum); }
  const Entry* shared_end(int sum) const { return begin(sum + 1); }
  const Entry* row_begin(int state) const { return begin(shared_ + state); }
  const Entry* row_end(int state) const { return begin(shared_ + state + 1); }

  /// Contiguous access: the row of `state` begins at row_start and ends at *row_ends, the next rows
  /// follow. The shared sums are the rows from -shared() on.
  const Entry* entries() const { return entry_.data(); }
  int row_start(int state) const { return *first_of(state); }
  const int* row_ends(int state) const { return first_of(state) + 1; }

  /// The states from this one on have no weight in the row of `state`, nor in its shared sums.
  int columns(int state) const { return columns_[static_cast<std::size_t>(shared_ + state)]; }

  /// As a dense matrix; slow.
  Matrix dense() const;

 private:
  static constexpr std::size_t max_rows = max_states + max_shared_sums;
  const int* first_of(int state) const { return first_.data() + shared_ + state; }
  const Entry* begin(int row) const {
    return entry_.data() + first_[static_cast<std::size_t>(row)];
  }

  int count_;
  int width_;
  int shared_ = 0;
  int rows_ = 0;
  int entries_ = 0;
  std::array<int, max_rows + 1> first_{};
  std::array<int, max_rows> columns_{};
  std::array<Entry, max_rows * max_states> entry_{};
};

}  // namespace stickslip::observer
