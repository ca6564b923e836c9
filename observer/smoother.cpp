#include "observer/smoother.h"

#include <Eigen/QR>
#include <array>
#include <cmath>
#include <deque>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <vector>

#include "observer/kalman_filter.h"

namespace stickslip::observer {

namespace {

Matrix matrix_of(const Covariance& covariance) {
  Matrix out(covariance.count(), covariance.count());
  for (int i = 0; i < covariance.count(); ++i) {
    for (int j = 0; j <= i; ++j) out(i, j) = out(j, i) = covariance(i, j);
  }
  return out;
}

struct Gaussian {
  Vector mean;
  Matrix covariance;
};

/// Triangular form of the equations `stack` (left sides, the right side as the last column), by
/// Householder reflections: the sum of squared residuals is the same function of the unknowns.
Eigen::MatrixXd triangular(const Eigen::MatrixXd& stack) {
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(stack);
  return qr.matrixQR().triangularView<Eigen::Upper>();
}

/// G with G G' = `covariance`, positive semidefinite; directions without variance are left out.
Matrix square_root(Matrix covariance) {
  Matrix root(covariance.rows(), covariance.cols());
  Eigen::Index columns = 0;
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
    if (!(covariance(i, i) > 0.0)) continue;
    const Vector direction = covariance.col(i) / std::sqrt(covariance(i, i));
    covariance -= direction * direction.transpose();
    root.col(columns++) = direction;
  }
  return root.leftCols(columns);
}

/// Likelihood of all later readings as a function of a state's deviation d from the filtered mean:
/// its logarithm is -|root d - value|^2 / 2. A square root of the information cannot lose symmetry
/// or definiteness (Bierman, Factorization Methods for Discrete Sequential Estimation, chapter VI).
struct BackwardInformation {
  Matrix root;  ///< upper triangular
  Vector value;
};

struct TimeUpdate {
  Matrix jacobian;
  Matrix process_noise;  ///< added before the transition
  Matrix output_noise;   ///< added after it
};

/// One period of the forward filter.
struct FilterStep {
  std::optional<TimeUpdate> time_update;  ///< none where the filter was initialised
  Vector predicted;                       ///< mean before the readings
  Gaussian filtered;                      ///< after the readings
  std::array<double, channel_count> innovation{};
  std::array<MeasurementRow, channel_count> row{};
  std::array<double, channel_count> inverse_variance{};  ///< of the readings; 0: not used
  std::optional<FrictionEstimate> estimate;              ///< none of a missing frame
};

class Smoother {
 public:
  Smoother(const physics::Model& model, double period_s, const SmoothingWindow& window,
           const std::function<void(const FrictionEstimate&)>& take)
      : filter_(model, period_s, FrictionPrior::from_recording),
        take_(take),
        keep_(static_cast<std::size_t>(std::max(1.0, window.keep_s / period_s))),
        ahead_(static_cast<std::size_t>(std::max(1.0, window.ahead_s / period_s))) {}

  void add(const Frame& frame);
  void finish() { smooth_steps(steps_.size()); }

 private:
  void time_update(KalmanFilter& filter);
  void record_readings(FilterStep& step);
  void smooth_steps(std::size_t keep);
  void step_back(const FilterStep& step, BackwardInformation& later) const;
  FrictionEstimate smoothed(const FilterStep& step, const BackwardInformation& later,
                            bool converged) const;

  KalmanFilter filter_;
  const std::function<void(const FrictionEstimate&)>& take_;
  std::size_t keep_, ahead_;
  std::deque<FilterStep> steps_;
};

void Smoother::time_update(KalmanFilter& filter) {
  FilterStep step;
  TimeUpdate update;
  update.process_noise = matrix_of(filter.process_noise());
  filter.predict();
  update.jacobian = filter.transition().dense();
  update.output_noise = matrix_of(filter.output_noise());
  step.time_update = std::move(update);
  step.predicted = filter.mean();
  step.filtered.mean = filter.mean();  // of a missing frame
  steps_.push_back(std::move(step));
}

void Smoother::add(const Frame& frame) {
  const FrictionEstimate& estimate = filter_.estimate();
  const std::uint64_t restarts = estimate.restarts;
  const std::size_t count = steps_.size();
  filter_.update(frame, [this](KalmanFilter& filter) { time_update(filter); });
  if (estimate.status == EstimateStatus::out_of_step) return;
  if (steps_.size() == count || estimate.restarts != restarts) {
    // After a reinitialisation the states are independent of the previous ones.
    steps_.resize(count);
    steps_.emplace_back();
  }
  FilterStep& step = steps_.back();
  step.filtered = {filter_.mean(), matrix_of(filter_.covariance())};
  step.estimate = estimate;
  if (step.time_update) record_readings(step);
  if (steps_.size() >= keep_ + ahead_) smooth_steps(keep_);
}

void Smoother::record_readings(FilterStep& step) {
  const unsigned used = step.estimate->innovation_valid & ~unsigned{step.estimate->refused};
  for (Channel channel : all_channels) {
    const std::size_t i = index_of(channel);
    if (((used >> i) & 1U) == 0) continue;
    const KalmanFilter::PredictedReading predicted =
        filter_.predict_reading(channel, filter_.frame(), step.predicted);
    step.row[i] = *predicted.row;
    step.innovation[i] = filter_.frame()[channel] - predicted.value;
    step.inverse_variance[i] = 1.0 / predicted.variance;
  }
}

// Equations of a step: those of the state after its readings, and the readings.
Eigen::MatrixXd equations_after(const FilterStep& step, const BackwardInformation& later) {
  const Eigen::Index n = later.root.cols();
  Eigen::MatrixXd stack =
      Eigen::MatrixXd::Zero(n + static_cast<Eigen::Index>(channel_count), n + 1);
  stack.topLeftCorner(n, n) = later.root;
  stack.col(n).head(n) = later.value + later.root * (step.filtered.mean - step.predicted);
  Eigen::Index used = n;
  for (Channel channel : all_channels) {
    const std::size_t i = index_of(channel);
    if (step.inverse_variance[i] == 0.0) continue;
    const double weight = std::sqrt(step.inverse_variance[i]);
    const MeasurementRow& row = step.row[i];
    for (std::size_t j = 0; j < static_cast<std::size_t>(row.count); ++j) {
      stack(used, row.state[j]) += weight * row.weight[j];
    }
    stack(used, n) = weight * step.innovation[i];
    ++used;
  }
  return stack.topRows(used);
}

// From the state after a step's readings to the state before its time update. With the noises u and
// w of unit variance it is d_after = F (d_before + G u) + H w; u and w are eliminated.
void Smoother::step_back(const FilterStep& step, BackwardInformation& later) const {
  const Eigen::MatrixXd after = equations_after(step, later);
  const Eigen::Index n = later.root.cols();
  const Matrix h = square_root(step.time_update->output_noise);
  const Matrix g = square_root(step.time_update->process_noise);
  const Eigen::Index noises = h.cols() + g.cols();
  Eigen::MatrixXd stack = Eigen::MatrixXd::Zero(noises + after.rows(), noises + n + 1);
  stack.topLeftCorner(noises, noises).setIdentity();
  const auto left = after.leftCols(n);
  stack.block(noises, noises, after.rows(), n) = left * step.time_update->jacobian;
  stack.block(noises, 0, after.rows(), h.cols()) = left * h;
  stack.block(noises, h.cols(), after.rows(), g.cols()) =
      stack.block(noises, noises, after.rows(), n) * g;
  stack.col(noises + n).tail(after.rows()) = after.col(n);
  const Eigen::MatrixXd reduced = triangular(stack);
  later.root = reduced.block(noises, noises, n, n);
  later.value = reduced.col(noises + n).segment(noises, n);
}

// Smooths all steps, and passes on and removes the first `keep` of them.
void Smoother::smooth_steps(std::size_t keep) {
  const auto no_information = [this] {
    const auto count = filter_.mean().size();
    return BackwardInformation{Matrix::Zero(count, count), Vector::Zero(count)};
  };
  BackwardInformation later = no_information();
  bool converged = false;  // the filter has been good later on since its initialisation
  std::vector<FrictionEstimate> out;
  for (std::size_t i = steps_.size(); i-- > 0;) {
    const FilterStep& step = steps_[i];
    if (step.estimate) {
      converged = converged || step.estimate->status == EstimateStatus::good;
      if (i < keep) out.push_back(smoothed(step, later, converged));
    }
    if (step.time_update) {
      step_back(step, later);
    } else {
      later = no_information();
      converged = false;
    }
  }
  for (std::size_t i = out.size(); i-- > 0;) take_(out[i]);
  steps_.erase(steps_.begin(), steps_.begin() + static_cast<std::ptrdiff_t>(keep));
}

FrictionEstimate Smoother::smoothed(const FilterStep& step, const BackwardInformation& later,
                                    bool converged) const {
  FrictionEstimate estimate = *step.estimate;
  if (estimate.status == EstimateStatus::waiting) return estimate;
  // Filtered and backward information combined in terms of y, where the deviation is L y and L L'
  // the filtered covariance: |y|^2 + |root L y - value|^2 is least.
  const Matrix& p = step.filtered.covariance;
  const Eigen::Index n = p.rows();
  const Matrix l = square_root(p);
  const Eigen::Index m = l.cols();
  Eigen::MatrixXd stack = Eigen::MatrixXd::Zero(m + n, m + 1);
  stack.topLeftCorner(m, m).setIdentity();
  stack.bottomLeftCorner(n, m) = later.root * l;
  stack.col(m).tail(n) = later.value;
  const Eigen::MatrixXd reduced = triangular(stack);
  const auto root = reduced.topLeftCorner(m, m).template triangularView<Eigen::Upper>();
  const Vector y = root.solve(reduced.col(m).head(m));
  const Vector mean = step.filtered.mean + l * y;
  const Matrix spread = root.transpose().solve(Matrix(l.transpose()));

  Covariance covariance(static_cast<int>(n));
  for (int i = 0; i < covariance.count(); ++i) {
    for (int j = 0; j <= i; ++j) covariance.set(i, j, spread.col(i).dot(spread.col(j)));
  }
  filter_.fill_estimate(mean, covariance, nullptr, estimate);
  // Also where the filter alone was still settling, or wrong.
  const bool by_filter = estimate.status == EstimateStatus::good ||
                         estimate.status == EstimateStatus::impossible ||
                         (estimate.status == EstimateStatus::settling && converged);
  if (by_filter) {
    estimate.status = is_possible(estimate) ? EstimateStatus::good : EstimateStatus::impossible;
  }
  estimate.valid = estimate.status == EstimateStatus::good;
  return estimate;
}

void count(const FrictionEstimate& e, PredictionQuality& quality) {
  for (std::size_t i = 0; i < channel_count; ++i) {
    if (((e.innovation_valid >> i) & 1U) == 0) continue;
    if (((e.refused >> i) & 1U) != 0) {
      ++quality.refused;
      continue;
    }
    const double variance = e.innovation_std[i] * e.innovation_std[i];
    const double squared = e.innovation[i] * e.innovation[i] / variance;
    quality.negative_log_likelihood +=
        0.5 * (squared + std::log(2.0 * std::numbers::pi * variance));
    quality.normalised_squares += squared;
    ++quality.readings;
  }
  quality.restarts = e.restarts;
}

/// Means of the estimates of mu and gamma, weighted by their inverse variances.
class ParameterMeans {
 public:
  void add(const FrictionEstimate& e) {
    if (!e.valid) return;
    mu_.add(e.mu, e.standard_deviation(Quantity::mu));
    gamma_.add(e.gamma_per_s, e.standard_deviation(Quantity::gamma));
  }
  /// The model with its values replaced by these means.
  physics::Model apply_to(physics::Model model) const {
    mu_.put(model.friction.mu);
    gamma_.put(model.friction.rate_per_s);
    return model;
  }

 private:
  struct Mean {
    double sum = 0.0;
    double weight = 0.0;
    void add(double value, double deviation) {
      if (!(deviation > 0.0)) return;
      sum += value / (deviation * deviation);
      weight += 1.0 / (deviation * deviation);
    }
    void put(physics::Parameter& parameter) const {
      if (weight > 0.0) parameter.value = sum / weight;
    }
  };
  Mean mu_, gamma_;
};

/// Share of the work in the first of the two passes.
constexpr double first_pass = 0.1;

}  // namespace

PredictionQuality smooth(const physics::Model& model, double period_s,
                         std::span<const Frame> frames,
                         const std::function<void(const FrictionEstimate&)>& take,
                         const SmoothingWindow& window,
                         const std::function<void(double share)>& progress) {
  if (!(period_s > 0.0)) throw std::invalid_argument("smooth: the period must be more than 0");
  // The second pass linearises about the parameters of the first.
  ParameterMeans means;
  KalmanFilter first(model, period_s);
  if (!first.unsupported().empty()) throw std::invalid_argument(first.unsupported());
  PredictionQuality quality;
  const double count_of_frames = static_cast<double>(frames.size());
  double done = 0.0;
  for (const Frame& frame : frames) {
    if (progress) progress(first_pass * done++ / count_of_frames);
    first.update(frame);
    means.add(first.estimate());
    if (first.estimate().status != EstimateStatus::out_of_step) count(first.estimate(), quality);
  }
  Smoother smoother(means.apply_to(model), period_s, window, take);
  done = 0.0;
  for (const Frame& frame : frames) {
    if (progress) progress(first_pass + (1.0 - first_pass) * done++ / count_of_frames);
    smoother.add(frame);
  }
  smoother.finish();
  return quality;
}

}  // namespace stickslip::observer
