// What is to be known of friction at best: a particle filter over the observer's own model, for
// filter_comparison. Rao-Blackwellised: what the contact's force depends on in a way that is not
// linear (slip velocity in both stages of a period, theta, mu, gamma, normal load) is drawn for
// each particle; all the rest (mass, load cell, base motion, sensor chains) is linear once the
// force is known, so each particle has a Kalman filter for it, whose covariance is the same for
// all. Nothing is drawn of the slip while every particle slides so fast that its friction does not
// depend on it.
//
// Against the model that the observer holds to be true it simplifies two things: the base motion's
// lambda is linearised about the particles' mean, and a wedge's normal load is that of a particle's
// mean x. It uses Bayes' rule throughout, without the observer's three choices of what not to learn
// from what.
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
  /// Begins with `guide`'s belief of now; its rig, layout and noises (which go on learning how wild
  /// the base motion is) are used from then on, so it must outlive this and be updated with every
  /// frame before. Throws std::invalid_argument for rigs other than base-excited ones that are
  /// linear but for friction without bristle.
  ParticleReference(RivalFilter& guide, double period_s, int particles, std::uint64_t seed);

  void update(const Frame& frame);

  double theta() const { return theta_mean_; }
  double force_n() const { return force_mean_; }
  double mu() const { return mu_mean_; }
  double theta_variance() const { return theta_variance_; }
  /// Of the weights, in particles: least of all frames so far.
  double least_effective() const { return least_effective_; }

 private:
  struct Discrete {
    Eigen::MatrixXd middle;                                          ///< of the first stage
    Eigen::MatrixXd whole;                                           ///< of the period
    Eigen::VectorXd by_middle_force, by_early_force, by_late_force;  ///< [per N]
    Eigen::MatrixXd bend;  ///< what p' and p'' add for each lambda beyond lambda_
  };
  void lay_out();
  Eigen::MatrixXd rates() const;
  void discretise();
  void draw_parameters();
  void draw_along(const Eigen::RowVectorXd& row, const Eigen::RowVectorXd& offset,
                  Eigen::RowVectorXd& drawn);
  void close(const Eigen::RowVectorXd& free_slip, double give, const Eigen::RowVectorXd& x,
             const Eigen::RowVectorXd& from, Eigen::RowVectorXd& theta, Eigen::RowVectorXd& force);
  void weigh(const Frame& frame);
  void report_and_resample();

  RivalFilter* guide_;
  double period_s_;
  std::vector<int> place_;   ///< of a state of the guide's layout among the linear ones; -1: none
  std::vector<int> linear_;  ///< the layout's states that are linear
  int count_ = 0;
  Eigen::VectorXd force_rate_;  ///< what a newton does to the rates
  Discrete discrete_;
  double lambda_ = 0.0;  ///< that discrete_ was made with
  long steps_ = 0;

  Eigen::MatrixXd means_;       ///< a column for each particle
  Eigen::MatrixXd covariance_;  ///< of all of them
  Eigen::RowVectorXd theta_, mu_, log_rate_, load_, force_, slip_;
  Eigen::RowVectorXd log_weight_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  double theta_mean_ = 0.0, force_mean_ = 0.0, mu_mean_ = 0.0, theta_variance_ = 0.0;
  double least_effective_ = 1.0e18;
};

}  // namespace stickslip::observer
