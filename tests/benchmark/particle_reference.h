// SPDX-License-Identifier: Apache-2.0
// Reference for filter_comparison: a Rao-Blackwellised particle filter on the observer's model.
// States on which the contact force depends nonlinearly (slip velocity in both stages of a period,
// theta, mu, gamma, normal load) are sampled. The others (mass, load cell, base motion, sensor
// chains) are linear given the force, so each particle has a Kalman filter for them, whose
// covariance is common to all. The slip velocity is not sampled while all particles slide so fast
// that friction does not depend on it.
//
// Simplifications of the observer's model: the base motion's lambda is linearised about the
// particles' mean, and the normal load of a wedge is that of a particle's mean x. All updates
// follow Bayes' rule, without the observer's restrictions of the gain.
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include <Eigen/Dense>

#include "rival_filters.h"

namespace stickslip::observer {

class ParticleReference {
 public:
  /// Starts from the current estimate of `guide`, whose rig, layout and adaptive noise are used
  /// from then on: it must outlive this, and be updated with every frame first. Throws
  /// std::invalid_argument for rigs other than base-excited ones that are linear except for
  /// friction without bristle.
  ParticleReference(RivalFilter& guide, double period_s, int particles, std::uint64_t seed);

  void update(const Frame& frame);

  double theta() const { return theta_mean_; }
  double force_n() const { return force_mean_; }
  double mu() const { return mu_mean_; }
  double theta_variance() const { return theta_variance_; }
  /// Smallest effective number of particles so far.
  double min_effective() const { return min_effective_; }

 private:
  struct Discrete {
    Eigen::MatrixXd middle;  ///< transition of the first stage
    Eigen::MatrixXd whole;   ///< transition of the period
    /// Per newton of the first stage at its end and at the period's end, and of the last stage.
    Eigen::VectorXd by_force_at_middle, by_middle_force, by_end_force;
    Eigen::MatrixXd by_lambda;  ///< derivative by lambda of the columns of p' and p''
  };
  void build_layout();
  Eigen::MatrixXd rates() const;
  void discretise();
  void add_process_noise();
  void sample_along(const Eigen::RowVectorXd& row, const Eigen::RowVectorXd& offset,
                    Eigen::RowVectorXd& drawn);
  void solve_stage(const Eigen::RowVectorXd& free_slip, double compliance,
                   const Eigen::RowVectorXd& x, const Eigen::RowVectorXd& from,
                   Eigen::RowVectorXd& theta, Eigen::RowVectorXd& force);
  void update_weights(const Frame& frame);
  void report_and_resample();

  RivalFilter* guide_;
  double period_s_;
  std::vector<int> place_;   ///< index of the guide's states among the linear ones; -1: none
  std::vector<int> linear_;  ///< linear states of the layout
  int count_ = 0;
  Discrete discrete_;
  double lambda_ = 0.0;  ///< of discrete_
  long steps_ = 0;

  Eigen::MatrixXd means_;       ///< one column per particle
  Eigen::MatrixXd covariance_;  ///< common to all
  Eigen::RowVectorXd theta_, mu_, log_rate_, load_, force_, slip_;
  Eigen::RowVectorXd log_weight_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  double theta_mean_ = 0.0, force_mean_ = 0.0, mu_mean_ = 0.0, theta_variance_ = 0.0;
  double min_effective_ = 1.0e18;
};

}  // namespace stickslip::observer
