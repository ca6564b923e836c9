// Covariance of the filter's states with its time update and measurement update, where almost all
// of the observer's time is spent.
#pragma once

#include <algorithm>
#include <array>

#include "observer/transition.h"

namespace stickslip::observer {

/// Symmetric; the upper triangle is stored. Rows are padded with zeros to whole registers.
class Covariance {
 public:
  /// Zero, for `count` states, at most max_states.
  explicit Covariance(int count);

  int count() const { return count_; }
  double operator()(int row, int column) const { return states_[place(row, column)]; }
  void set(int row, int column, double value) { states_[place(row, column)] = value; }
  void add(int row, int column, double value) { states_[place(row, column)] += value; }
  void set_zero() { states_.fill(0.0); }

  /// Time update: P becomes F P F'.
  void propagate(const Transition& transition);

  /// One value per state.
  struct alignas(32) States {
    std::array<double, padded(max_states)> of{};
    double& operator[](int i) { return of[static_cast<std::size_t>(i)]; }
    double operator[](int i) const { return of[static_cast<std::size_t>(i)]; }
  };

  /// A column of P: P H' for a reading of one state.
  void column(int state, States& out) const;
  /// Measurement update in Joseph form, for any scalar reading and any gain K: P becomes
  /// (I - K H) P (I - K H)' + K r K'. `column`: P H'; `innovation_variance`: H P H' + r.
  void correct(const States& gain, const States& column, double innovation_variance);

 private:
  static constexpr int most = padded(max_states);
  std::size_t place(int row, int column) const {
    const auto [low, high] = std::minmax(row, column);
    return static_cast<std::size_t>(low) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(high);
  }
  void mirror();

  int count_;
  int width_;  ///< of a row
  // The rows of the states are followed by those of a transition's shared sums.
  static constexpr std::size_t with_sums = std::size_t{most + max_shared_sums} * std::size_t{most};
  alignas(64) std::array<double, with_sums> states_{};
  alignas(64) std::array<double, with_sums> transposed_{};
  alignas(64) std::array<double, std::size_t{4} * std::size_t{most}> product_{};  ///< four rows
};

}  // namespace stickslip::observer
