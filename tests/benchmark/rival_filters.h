// SPDX-License-Identifier: Apache-2.0
// Alternative filters with the observer's model, noise and rules, for filter_comparison: they
// differ only in how the distribution of the state is propagated through the contact. Dense Eigen
// matrices on the heap; not optimised.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "observer/covariance.h"
#include "observer/kalman_filter.h"
#include "observer/layout.h"
#include "observer/noise.h"
#include "observer/prediction.h"

namespace stickslip::observer {

struct Gaussian {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

/// Result of an update with a frame.
struct FrameResult {
  double log_likelihood = 0.0;  ///< up to a constant
  double nis = 0.0;
  int nis_freedom = 0;
  std::uint8_t refused = 0;  ///< bit i: channel i
  double drive = 0.0;        ///< normalised innovation of the drive's channel
};

/// The rules of KalmanFilter for any prediction: initialisation, start, restrictions of the gain,
/// rejection of outliers, restarts. One frame per period, with readings of age 0.
class RivalFilter {
 public:
  /// Throws std::invalid_argument where KalmanFilter does not support the model.
  RivalFilter(const physics::Model& model, double period_s);
  virtual ~RivalFilter() = default;
  RivalFilter(const RivalFilter&) = delete;
  RivalFilter& operator=(const RivalFilter&) = delete;

  const FrictionEstimate& update(const Frame& frame);

  const Gaussian& estimate() const { return state_; }
  const Layout& layout() const { return layout_; }
  const NoiseModel& noise() const { return *noise_; }
  const physics::Rig& rig() const { return rig_; }
  const physics::RigNumbers<double>& numbers() const { return prediction_->numbers(); }

  /// Process noise of the core states over one period.
  Eigen::MatrixXd process_noise(const Gaussian& estimate, double slip_variance);

 protected:
  /// Updates the estimate from the last frame to this one.
  virtual FrameResult update_state(const Frame& frame, Gaussian& estimate) = 0;
  /// Called after an initialisation or reinitialisation.
  virtual void reinitialised(const Gaussian& /*estimate*/) {}

  /// Row of the slip velocity.
  Eigen::RowVectorXd slip_row() const;
  double slip_variance(const Eigen::MatrixXd& covariance) const;
  void add_output_noise(Gaussian& estimate);
  /// The observer's prediction, F (P + Q) F', with the tanh widened by a variance of the slip
  /// velocity.
  void predict(Gaussian& estimate, double slip_variance);
  /// Measurement update with all readings of a frame, by the observer's rules.
  FrameResult correct(const Frame& frame, Gaussian& estimate) const;

  std::string reason_;
  physics::Model model_;
  physics::Rig rig_;
  double period_s_;
  Layout layout_;
  KalmanFilter reporter_;  ///< only converts a state to an estimate
  std::unique_ptr<Prediction> prediction_;
  std::unique_ptr<NoiseModel> noise_;
  double since_start_s_ = 0.0;
  double startup_s_ = 0.0;

 private:
  void begin(const Frame& frame);
  bool is_healthy(const FrameResult& seen);

  double settle_s_ = 0.0;
  bool started_ = false;
  double since_drive_s_ = 1.0e9;
  double nis_level_ = 1.0;
  double implausible_s_ = 0.0;
  std::vector<int> refused_in_a_row_;
  Gaussian state_;
  Covariance scratch_;
  FrictionEstimate estimate_;
};

/// The observer's filter with dense matrices; must agree with KalmanFilter.
class LinearisedFilter final : public RivalFilter {
 public:
  using RivalFilter::RivalFilter;

 private:
  FrameResult update_state(const Frame& frame, Gaussian& estimate) override;
};

/// Textbook extended Kalman filter: derivative of tanh at the mean, without widening and its
/// additional noise.
class TangentFilter final : public RivalFilter {
 public:
  using RivalFilter::RivalFilter;

 private:
  FrameResult update_state(const Frame& frame, Gaussian& estimate) override;
};

/// Iterated filter: relinearises the period `rounds` times about its start as smoothed by the
/// readings at its end, with the smoothed variance of the slip velocity.
class IteratedFilter final : public RivalFilter {
 public:
  IteratedFilter(const physics::Model& model, double period_s, int rounds)
      : RivalFilter(model, period_s), rounds_(rounds) {}

 private:
  FrameResult update_state(const Frame& frame, Gaussian& estimate) override;
  int rounds_;
};

/// Second-order divided differences, or a cubature rule, in place of derivatives and of the widened
/// tanh. Points only along the directions of the core: the period is linear in the others.
class SigmaPointFilter final : public RivalFilter {
 public:
  enum class Points {
    near,  ///< at sqrt(3) standard deviations, second-order divided differences
    far,   ///< at sqrt(states) standard deviations, equal weights: cubature rule
  };
  SigmaPointFilter(const physics::Model& model, double period_s, Points points)
      : RivalFilter(model, period_s), points_(points) {}

 private:
  FrameResult update_state(const Frame& frame, Gaussian& estimate) override;
  Points points_;
};

/// Three interacting filters, for sticking and for slip in either direction. The mode is determined
/// by the slip velocity: before each period the distribution of every filter is truncated at the
/// limits, the parts in each region are merged into one Gaussian, and each is predicted with its
/// own, smaller variance of the slip velocity.
class InteractingFilter final : public RivalFilter {
 public:
  using RivalFilter::RivalFilter;

 private:
  struct Mode {
    double weight = 0.0;
    Gaussian estimate;
  };
  FrameResult update_state(const Frame& frame, Gaussian& estimate) override;
  void reinitialised(const Gaussian& estimate) override { modes_ = {{1.0, estimate}}; }
  std::vector<Mode> mixed() const;

  std::vector<Mode> modes_;
};

/// Gaussian with the mean and covariance of a mixture; the weights sum to 1.
Gaussian merged(const std::vector<double>& weights, const std::vector<Gaussian>& estimates);

/// Lower triangular L with L L' = P, for a covariance of any rank.
Eigen::MatrixXd root_of(const Eigen::MatrixXd& covariance);

}  // namespace stickslip::observer
