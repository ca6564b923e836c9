// The covariance of the filter's states, and the two things that happen to it: a period passes, and
// a reading is used. Almost all of the observer's time is spent here.
#pragma once

#include <algorithm>
#include <array>

#include "observer/transition.h"

namespace stickslip::observer {

/// Symmetric, of which the lower triangle is kept. Rows are padded with zeros to whole registers.
class Covariance {
 public:
  /// Zero, for `count` states, at most max_states.
  explicit Covariance(int count);

  int count() const { return count_; }
  double operator()(int row, int column) const { return states_[place(row, column)]; }
  void set(int row, int column, double value) { states_[place(row, column)] = value; }
  void add(int row, int column, double value) { states_[place(row, column)] += value; }
  void set_zero() { states_.fill(0.0); }

  /// P becomes F P F'.
  void propagate(const Transition& transition);

  /// One value for each state.
  struct alignas(32) States {
    std::array<double, padded(max_states)> of{};
    double& operator[](int i) { return of[static_cast<std::size_t>(i)]; }
    double operator[](int i) const { return of[static_cast<std::size_t>(i)]; }
  };

  /// A column of P: P H' for a reading of one state.
  void column(int state, States& out) const;
  /// P becomes (I - K H) P (I - K H)' + K r K' for any reading and any gain K; `column`
  /// is P H', `expected` is H P H' + r. Joseph's form, so P stays a covariance.
  void correct(const States& gain, const States& column, double expected);

 private:
  static constexpr int most = padded(max_states);
  std::size_t place(int row, int column) const {
    const auto [low, high] = std::minmax(row, column);
    return static_cast<std::size_t>(high) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(low);
  }
  void mirror();

  int count_;
  int width_;  ///< of a row
  // Behind the states' rows come those of the shared sums of a transition.
  static constexpr std::size_t with_sums = std::size_t{most + max_shared_sums} * std::size_t{most};
  alignas(64) std::array<double, with_sums> states_{};
  alignas(64) std::array<double, with_sums> turned_{};
  alignas(64) std::array<double, static_cast<std::size_t>(most* most)> half_{};
};

}  // namespace stickslip::observer
