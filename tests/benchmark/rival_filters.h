// Other filters over the observer's own model, noises and rules, for filter_comparison: what
// differs is only how a doubtful state is carried through the contact. Dense matrices of Eigen, on
// the heap; written to be compared, not to be quick.
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

/// A Gaussian.
struct Belief {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

/// What a frame said about a belief.
struct Sighting {
  double log_likelihood = 0.0;  ///< but for a constant
  double nis = 0.0;
  int nis_freedom = 0;
  std::uint8_t refused = 0;  ///< bit i: channel i
  double drive = 0.0;        ///< normalised innovation of the drive's channel
};

/// The rules of KalmanFilter around any way to predict: start, settling, what is learnt when,
/// refusals and restarts. Frames must come one a period, their readings fresh.
class RivalFilter {
 public:
  /// Throws std::invalid_argument where KalmanFilter does not support the model.
  RivalFilter(const physics::Model& model, double period_s);
  virtual ~RivalFilter() = default;
  RivalFilter(const RivalFilter&) = delete;
  RivalFilter& operator=(const RivalFilter&) = delete;

  const FrictionEstimate& update(const Frame& frame);

  const Belief& belief() const { return belief_; }
  const Layout& layout() const { return layout_; }
  const Noise& noise() const { return *noise_; }
  const physics::Rig& rig() const { return rig_; }
  const physics::RigNumbers<double>& numbers() const { return prediction_->numbers(); }

  /// What a period adds to the doubt of these states before it passes.
  Eigen::MatrixXd process_noise(const Belief& belief, double slip_variance);

 protected:
  /// Takes the belief from the last frame to this one.
  virtual Sighting pass(const Frame& frame, Belief& belief) = 0;
  /// The filter begins anew from `belief`.
  virtual void begun(const Belief& /*belief*/) {}

  /// A row that gives the slip velocity.
  Eigen::RowVectorXd slip_row() const;
  double slip_variance(const Eigen::MatrixXd& covariance) const;
  void add_output_noise(Belief& belief);
  /// The observer's own prediction, F (P + Q) F', with the tanh widened by `doubt`, a variance of
  /// the slip velocity.
  void predict(Belief& belief, double doubt);
  /// Uses all readings of a frame, by the observer's rules.
  Sighting correct(const Frame& frame, Belief& belief) const;

  std::string reason_;
  physics::Model model_;
  physics::Rig rig_;
  double period_s_;
  Layout layout_;
  KalmanFilter teller_;  ///< only says what a belief means
  std::unique_ptr<Prediction> prediction_;
  std::unique_ptr<Noise> noise_;
  double since_start_s_ = 0.0;
  double learn_s_ = 0.0;

 private:
  void begin(const Frame& frame);
  bool is_healthy(const Sighting& seen);

  double settle_s_ = 0.0;
  bool started_ = false;
  double since_drive_s_ = 1.0e9;
  double nis_level_ = 1.0;
  double absurd_s_ = 0.0;
  std::vector<int> refused_in_a_row_;
  Belief belief_;
  Covariance scratch_;
  FrictionEstimate estimate_;
};

/// The observer's filter in this form: must say what KalmanFilter says.
class LinearisedFilter final : public RivalFilter {
 public:
  using RivalFilter::RivalFilter;

 private:
  Sighting pass(const Frame& frame, Belief& belief) override;
};

/// As a textbook has it: the tanh's derivative at the mean alone, without the widened tanh and
/// without noise for what that leaves out.
class TangentFilter final : public RivalFilter {
 public:
  using RivalFilter::RivalFilter;

 private:
  Sighting pass(const Frame& frame, Belief& belief) override;
};

/// Linearises the period `rounds` more times, about what its end's readings say of its start, and
/// with the slip's doubt that is left then.
class IteratedFilter final : public RivalFilter {
 public:
  IteratedFilter(const physics::Model& model, double period_s, int rounds)
      : RivalFilter(model, period_s), rounds_(rounds) {}

 private:
  Sighting pass(const Frame& frame, Belief& belief) override;
  int rounds_;
};

/// Second-order divided differences, or a cubature, in place of derivatives: the tanh is taken at
/// points, not widened. Points lie only along the core's directions; in the others the period is
/// linear, so that their points would give the same.
class SigmaPointFilter final : public RivalFilter {
 public:
  enum class Points {
    near,  ///< sqrt(3) deviations out, divided differences of second order
    far,   ///< sqrt(states) deviations out, equal weights: the cubature rule
  };
  SigmaPointFilter(const physics::Model& model, double period_s, Points points)
      : RivalFilter(model, period_s), points_(points) {}

 private:
  Sighting pass(const Frame& frame, Belief& belief) override;
  Points points_;
};

/// Three interacting filters, for a contact that sticks and one that slips forwards or backwards.
/// Which one holds is a matter of the slip velocity: before each period every filter's belief is
/// cut at the limits, the parts that lie in a region are merged into one Gaussian, and each is
/// predicted with its own, lesser doubt of the slip.
class InteractingFilter final : public RivalFilter {
 public:
  using RivalFilter::RivalFilter;

 private:
  struct Mode {
    double weight = 0.0;
    Belief belief;
  };
  Sighting pass(const Frame& frame, Belief& belief) override;
  void begun(const Belief& belief) override { modes_ = {{1.0, belief}}; }
  std::vector<Mode> mixed() const;

  std::vector<Mode> modes_;
};

/// The Gaussian with the mean and the covariance of a mixture, whose weights sum to 1.
Belief merged(const std::vector<double>& weights, const std::vector<Belief>& beliefs);

/// L with L L' = P for a covariance that need not have full rank.
Eigen::MatrixXd root_of(const Eigen::MatrixXd& covariance);

}  // namespace stickslip::observer
