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
  /// `layout` must outlive it.
  ConsiderParameters(std::unique_ptr<ParameterResponse> response, ReadingErrors errors,
                     const Layout& layout);

  /// True if the model has any.
  bool any() const { return !group_.empty(); }

  /// Zero sensitivity: the filter has been reinitialised from readings alone.
  void reset();

  /// Time update, after the prediction of the period from `before` to `after`
  /// (ParameterResponse::update).
  void propagate(const Transition& transition, const Vector& before, const Vector& after,
                 double time_s, double transition_speed_m_s);

  /// The readings of a frame before their correction.
  void read(const Frame& raw);
  /// Variance that the parameters add to the innovation of a reading.
  double project(Channel channel, const MeasurementRow& row, const Vector& mean);
  /// Adds their share of the covariance of states and innovation, for the reading projected last.
  void add_to(Covariance::States& column) const;
  /// Measurement update with this gain, for the reading projected last.
  void correct(const Covariance::States& gain);

  int count() const { return response_->count() + errors_.count(); }
  /// Errors of the states for an error of one standard deviation of each parameter, one column
  /// each.
  Eigen::MatrixXd sensitivity() const { return columns_of(group_); }
  /// Changes of the states over the last period, likewise.
  Eigen::MatrixXd input() const { return columns_of(input_); }
  /// Direct changes of the normal load, besides those by the states.
  Eigen::VectorXd load() const;
  /// Direct changes of the reading of a channel, likewise.
  Eigen::VectorXd reading_errors(Channel channel, const Vector& mean) const;

  /// Contribution to the covariance of these quantities, in their order; other elements of `out`
  /// are not changed.
  void covariance_of(std::span<const QuantityRow> quantities,
                     std::array<std::array<double, quantity_count>, quantity_count>& out) const;
  /// Contribution to the variance of the slip velocity [(m/s)^2].
  double slip_variance() const;

 private:
  static constexpr int lanes = parameter_lanes;
  using Lanes = ParameterLanes;
  using Group = std::array<Lanes, static_cast<std::size_t>(padded(max_states) + max_shared_sums)>;

  Eigen::MatrixXd columns_of(const std::vector<Group>& groups) const;
  void propagate(Group& group, const Transition& transition);
  void find_input(const Vector& before);

  std::unique_ptr<ParameterResponse> response_;
  ReadingErrors errors_;
  const Layout* layout_;
  std::vector<Group> group_;  ///< sensitivities, parameters in groups of four
  std::vector<Group> input_;  ///< of the rig's states, in this period
  std::vector<int> driven_;   ///< states that input_ changes
  std::vector<Lanes> error_;  ///< of the innovation
  std::vector<Lanes> load_;   ///< direct changes of the normal load
  Group next_;
};

}  // namespace stickslip::observer
