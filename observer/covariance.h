// SPDX-License-Identifier: Apache-2.0
// Covariance of the filter's states with its time update and measurement update, where almost all
// of the observer's time is spent.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "observer/transition.h"

namespace stickslip::observer {

inline constexpr int parameter_lanes = 4;
/// One value for each of four parameters, for an error of one standard deviation.
using ParameterLanes = Eigen::Array<double, parameter_lanes, 1>;

/// The covariance P of the states for given parameters of the model, and the sensitivities S of the
/// states' errors to those of the parameters: the covariance for uncertain parameters is P + S S'.
/// P is symmetric; its upper triangle is stored. Rows are padded with zeros to whole registers.
class Covariance {
 public:
  /// Zero, for `count` states, at most max_states.
  explicit Covariance(int count, int parameters = 0);

  int count() const { return count_; }
  double operator()(int row, int column) const { return rows_.data()[place(row, column)]; }
  void set(int row, int column, double value) { rows_.data()[place(row, column)] = value; }
  void add(int row, int column, double value) { rows_.data()[place(row, column)] += value; }
  void set_zero() { rows_.fill(0.0); }

  /// Groups of four parameters.
  int groups() const { return offset_ / parameter_lanes; }
  /// Sensitivities of a state to a group of parameters.
  using Sensitivity = Eigen::Map<ParameterLanes, Eigen::Aligned32>;
  using ConstSensitivity = Eigen::Map<const ParameterLanes, Eigen::Aligned32>;
  Sensitivity sensitivity(int state, int group) {
    return Sensitivity(row(state) + parameter_lanes * group);
  }
  ConstSensitivity sensitivity(int state, int group) const {
    return ConstSensitivity(row(state) + parameter_lanes * group);
  }

  /// Width of a row: sensitivities and covariance.
  int width() const { return width_; }

  /// Time update: P becomes F P F', S becomes F S. The transition's width is that of the rows.
  void propagate(const Transition& transition);

  /// One value per state.
  struct alignas(32) States {
    std::array<double, padded(max_states)> of{};
    double& operator[](int i) { return of[static_cast<std::size_t>(i)]; }
    double operator[](int i) const { return of[static_cast<std::size_t>(i)]; }
  };

  /// A column of P: P H' for a reading of one state.
  void column(int state, States& out) const;
  /// Optimal gain (P H' + S e) / s for a reading with `column` P H', sensitivities `error`, which
  /// are e = H S + D, and the variance s of its innovation, that of the parameters included.
  void optimal_gain(const States& column, std::span<const ParameterLanes> error,
                    double innovation_variance, States& gain) const;
  /// Measurement update in Joseph form, for any scalar reading and any gain K: P becomes
  /// (I - K H) P (I - K H)' + K r K', S becomes S - K e'. `column`: P H'; `innovation_variance`:
  /// H P H' + r. `error`: empty where it is 0.
  void correct(const States& gain, const States& column, double innovation_variance,
               std::span<const ParameterLanes> error = {});

 private:
  static constexpr int most = padded(max_states);
  double* row(int state) { return rows_.data() + state * width_; }
  const double* row(int state) const { return rows_.data() + state * width_; }
  std::size_t place(int row, int column) const {
    const auto [low, high] = std::minmax(row, column);
    return static_cast<std::size_t>(low * width_ + offset_ + high);
  }
  void mirror();
  void add_shared(const Transition& f, double* rows) const;
  void multiply_from_left(const Transition& f);

  /// Numbers that begin at a cache line.
  class Storage {
   public:
    /// One line at least: a filter without consider parameters has an address for them, too.
    explicit Storage(int count = 0)
        : lines_(static_cast<std::size_t>(std::max(1, (count + 7) / 8))) {}
    double* data() { return lines_.data()->of.data(); }
    const double* data() const { return lines_.data()->of.data(); }
    void fill(double value) {
      for (Line& line : lines_) line.of.fill(value);
    }

   private:
    struct alignas(64) Line {
      std::array<double, 8> of{};
    };
    std::vector<Line> lines_;
  };
  int count_;
  int offset_;  ///< of P in a row, after S
  int width_;   ///< of a row
  // The rows of the states are followed by those of a transition's shared sums.
  Storage rows_;
  Storage transposed_;     ///< (F P)'
  Storage sensitivities_;  ///< F S
  Storage product_;        ///< four rows of F (S, P)
};

}  // namespace stickslip::observer
