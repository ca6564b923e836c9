// SPDX-License-Identifier: Apache-2.0
// Consider parameters (Schmidt-Kalman filter): parameters of the model with a standard deviation
// that are no states of the filter. As process noise their uncertainty would average out, but the
// error of a constant does not. The sensitivity of the estimate to an error of one standard
// deviation of each is propagated through the filter's own transitions and gains; it widens the
// innovations, reduces the gains and is part of the covariance that is reported.
//
// S. F. Schmidt, Application of state-space methods to navigation problems, Advances in Control
// Systems 3 (1966); with the covariance of states and parameters in the factored form P + S S'.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "observer/covariance.h"
#include "observer/layout.h"
#include "observer/observer.h"
#include "observer/parameter_response.h"
#include "observer/reading_errors.h"
#include "observer/transition.h"

namespace stickslip::observer {

/// A quantity of an estimate as a weighted sum of up to two states; -1: none.
struct QuantityRow {
  std::array<int, 2> state = {-1, -1};
  std::array<double, 2> weight = {0.0, 0.0};
  bool is_load = false;  ///< which depends on parameters directly, too
};

class ConsiderParameters {
 public:
  /// `covariance` holds the sensitivities, of as many parameters. It and `layout` must outlive it.
  ConsiderParameters(std::unique_ptr<ParameterResponse> response, ReadingErrors errors,
                     const Layout& layout, Covariance& covariance);

  /// True if the model has any.
  bool any() const { return !error_.empty(); }

  /// Time update, after that of the covariance and the prediction of the period from `before` to
  /// `after` (ParameterResponse::update).
  void propagate(const Vector& before, const Vector& after, double time_s,
                 double transition_speed_m_s);

  /// The readings of a frame before their correction.
  void read(const Frame& raw);
  /// Variance that the parameters add to the innovation of a reading.
  double project(Channel channel, const MeasurementRow& row, const Vector& mean);
  /// Errors of the innovation of the reading projected last; empty where all are 0, as those of
  /// the drive, which does not depend on the parameters.
  std::span<const ParameterLanes> innovation_error() const {
    return affects_ ? std::span<const ParameterLanes>(error_) : std::span<const ParameterLanes>();
  }

  int count() const { return response_->count() + errors_.count(); }
  /// Errors of the states for an error of one standard deviation of each parameter, one column
  /// each.
  Eigen::MatrixXd sensitivity() const;
  /// Changes of the states over the last period, likewise.
  Eigen::MatrixXd input() const;
  /// Direct changes of the normal load, besides those by the states.
  Eigen::VectorXd load() const;
  /// Direct changes of the reading of a channel, likewise.
  Eigen::VectorXd reading_errors(Channel channel, const Vector& mean) const;

  /// Contribution to the covariance of these quantities, in their order: its lower triangle; other
  /// elements of `out` are not changed.
  void covariance_of(std::span<const QuantityRow> quantities,
                     std::array<std::array<double, quantity_count>, quantity_count>& out) const;
  /// Contribution to the variance of the slip velocity [(m/s)^2].
  double slip_variance() const;

 private:
  static constexpr int lanes = parameter_lanes;
  using Lanes = ParameterLanes;
  using Group = std::array<Lanes, std::size_t{max_states}>;

  void find_input(const Vector& before);

  std::unique_ptr<ParameterResponse> response_;
  ReadingErrors errors_;
  const Layout* layout_;
  Covariance* covariance_;
  std::vector<Group> input_;  ///< changes of states in this period, parameters in groups of four
  std::vector<int> driven_;   ///< states that input_ changes
  std::vector<Lanes> error_;  ///< of the innovation
  bool affects_ = false;      ///< true if any of these is not 0
  std::vector<Lanes> load_;   ///< direct changes of the normal load
};

}  // namespace stickslip::observer
