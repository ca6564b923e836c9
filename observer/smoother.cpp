#include "observer/smoother.h"

#include <Eigen/LU>
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

/// Likelihood of all later readings as a function of a state's deviation d from the filtered mean:
/// its logarithm is -d' matrix d / 2 + d' vector.
struct BackwardInformation {
  Matrix matrix;
  Vector vector;

  /// Accounts for `noise` between the state and the later readings.
  void add_noise(Matrix noise);
};

void BackwardInformation::add_noise(Matrix noise) {
  // One direction of the noise after the other, as in a Cholesky factorisation.
  for (Eigen::Index i = 0; i < noise.rows(); ++i) {
    if (!(noise(i, i) > 0.0)) continue;
    const Vector direction = noise.col(i) / std::sqrt(noise(i, i));
    noise -= direction * direction.transpose();
    const Vector projected = matrix * direction;
    const double share = 1.0 / (1.0 + direction.dot(projected));
    vector -= projected * (share * direction.dot(vector));
    matrix -= share * projected * projected.transpose();
  }
}

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

// From the state after a step's readings to the state before its time update.
void Smoother::step_back(const FilterStep& step, BackwardInformation& later) const {
  later.vector += later.matrix * (step.filtered.mean - step.predicted);
  for (Channel channel : all_channels) {
    const std::size_t i = index_of(channel);
    if (step.inverse_variance[i] == 0.0) continue;
    const MeasurementRow& row = step.row[i];
    const auto terms = static_cast<std::size_t>(row.count);
    for (std::size_t j = 0; j < terms; ++j) {
      for (std::size_t k = 0; k < terms; ++k) {
        later.matrix(row.state[j], row.state[k]) +=
            step.inverse_variance[i] * row.weight[j] * row.weight[k];
      }
      later.vector[row.state[j]] += step.inverse_variance[i] * row.weight[j] * step.innovation[i];
    }
  }
  later.add_noise(step.time_update->output_noise);
  const Matrix& f = step.time_update->jacobian;
  later.matrix = (f.transpose() * later.matrix * f).eval();
  later.vector = (f.transpose() * later.vector).eval();
  later.add_noise(step.time_update->process_noise);
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
  // Filtered and backward information combined, P - P W (1 + P W)^-1 P, with states scaled by their
  // standard deviations.
  const Matrix& p = step.filtered.covariance;
  const Vector scale = p.diagonal().cwiseMax(1.0e-300).cwiseSqrt();
  const auto scaled = scale.asDiagonal();
  const auto unscaled = scale.cwiseInverse().asDiagonal();
  const Matrix prior = unscaled * p * unscaled;
  const Matrix product = prior * (scaled * later.matrix * scaled);
  const Matrix posterior =
      (Matrix::Identity(p.rows(), p.cols()) + product).partialPivLu().solve(prior);
  const Vector mean = step.filtered.mean + scaled * (posterior * (scaled * later.vector));

  Covariance covariance(static_cast<int>(p.rows()));
  for (int i = 0; i < covariance.count(); ++i) {
    for (int j = 0; j <= i; ++j) {
      covariance.set(i, j, 0.5 * (posterior(i, j) + posterior(j, i)) * scale[i] * scale[j]);
    }
  }
  filter_.fill_estimate(mean, covariance, nullptr, estimate);
  if (estimate.status == EstimateStatus::settling && converged) {
    estimate.status = EstimateStatus::good;
    estimate.valid = true;
  }
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
