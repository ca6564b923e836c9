// SPDX-License-Identifier: Apache-2.0
#include "observer/smoother.h"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "observer/kalman_filter.h"
#include "physics/model_consistency.h"

namespace stickslip::observer {

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Variances and covariances that are not 0; far fewer than those of a matrix.
struct SparseNoise {
  struct Entry {
    int row;
    int column;
    double value;
  };
  std::vector<Entry> entries;

  explicit SparseNoise(const Covariance& covariance) {
    for (int i = 0; i < covariance.count(); ++i) {
      for (int j = 0; j <= i; ++j) {
        if (covariance(i, j) != 0.0) entries.push_back({i, j, covariance(i, j)});
      }
    }
  }
  MatrixXd dense(Eigen::Index count) const {
    MatrixXd out = MatrixXd::Zero(count, count);
    for (const Entry& each : entries) {
      out(each.row, each.column) = out(each.column, each.row) = each.value;
    }
    return out;
  }
};

/// The elements of a matrix of up to max_states rows that are not 0; a fraction of all.
class SparseMatrix {
 public:
  template <class Dense>
  explicit SparseMatrix(const Dense& dense)
      : rows_(static_cast<int>(dense.rows())), columns_(static_cast<int>(dense.cols())) {
    const auto count = static_cast<std::size_t>((dense.array() != 0.0).count());
    value_.reserve(count);
    place_.reserve(count);
    for (Eigen::Index i = 0; i < dense.size(); ++i) {
      if (dense.data()[i] == 0.0) continue;
      value_.push_back(dense.data()[i]);
      place_.push_back(static_cast<std::uint16_t>(i));
    }
  }
  MatrixXd dense() const {
    MatrixXd out = MatrixXd::Zero(rows_, columns_);
    for (std::size_t i = 0; i < value_.size(); ++i) out.data()[place_[i]] = value_[i];
    return out;
  }

 private:
  int rows_, columns_;
  std::vector<double> value_;
  std::vector<std::uint16_t> place_;  ///< in a matrix by columns
};

/// The lower triangle, by rows.
VectorXd packed(const Covariance& covariance) {
  const int n = covariance.count();
  VectorXd out(n * (n + 1) / 2);
  Eigen::Index next = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) out[next++] = covariance(i, j);
  }
  return out;
}

MatrixXd unpacked(const VectorXd& triangle, Eigen::Index count) {
  MatrixXd out(count, count);
  Eigen::Index next = 0;
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) out(i, j) = out(j, i) = triangle[next++];
  }
  return out;
}

/// Triangular form of the equations `stack` (left sides, the right side as the last column), by
/// Householder reflections: the sum of squared residuals is the same function of the unknowns.
MatrixXd triangular(const MatrixXd& stack) {
  const Eigen::HouseholderQR<MatrixXd> qr(stack);
  return qr.matrixQR().triangularView<Eigen::Upper>();
}

/// G with G G' = `covariance`, positive semidefinite; directions without variance are left out.
MatrixXd square_root(MatrixXd covariance) {
  MatrixXd root(covariance.rows(), covariance.cols());
  Eigen::Index columns = 0;
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
    if (!(covariance(i, i) > 0.0)) continue;
    const VectorXd direction = covariance.col(i) / std::sqrt(covariance(i, i));
    covariance -= direction * direction.transpose();
    root.col(columns++) = direction;
  }
  return root.leftCols(columns);
}

/// Likelihood of all later readings as a function of a state's deviation d from the filtered mean
/// and of the errors p of the consider parameters, in standard deviations: its logarithm is
/// -|root (d, p) - value|^2 / 2. A square root of the information cannot lose symmetry or
/// definiteness (Bierman, Factorization Methods for Discrete Sequential Estimation, chapter VI).
struct BackwardInformation {
  MatrixXd root;  ///< upper triangular
  VectorXd value;
};

/// d' = jacobian (d + u) + w + by_parameters p, with the noises u and w.
struct TimeUpdate {
  SparseMatrix jacobian;
  SparseMatrix by_parameters;
  SparseNoise process_noise;
  SparseNoise output_noise;
};

struct Reading {
  double innovation = 0.0;
  double weight = 0.0;  ///< inverse standard deviation
  std::vector<std::pair<int, double>> by_states;
  VectorXd by_parameters;
};

/// One period of the forward filter.
struct FilterStep {
  std::optional<TimeUpdate> time_update;  ///< none where the filter was initialised
  VectorXd predicted;                     ///< mean before the readings
  VectorXd filtered;                      ///< mean after the readings
  /// After the readings: packed covariance, and errors of the mean by the consider parameters.
  /// Empty where a frame is missing.
  VectorXd covariance;
  MatrixXd by_parameters;
  VectorXd load_by_parameters;
  std::vector<Reading> readings;
  std::optional<FrictionEstimate> estimate;  ///< none of a missing frame
};

/// Errors of the consider parameters, in standard deviations.
struct ParameterErrors {
  VectorXd mean;
  double variance = std::numeric_limits<double>::infinity();  ///< their sum
};

// Longest step of the integration. All later readings together know the time of a reversal better
// than half a sampling period.
constexpr double step_s = 2.5e-4;

/// Receives each smoothed estimate, with all states.
using Take = std::function<void(const FrictionEstimate&, const Vector& mean)>;

class Smoother {
 public:
  /// `expected`: errors of the consider parameters that the model's own prior expects of `model`,
  /// which may have other values than those declared; empty: none.
  Smoother(const physics::Model& model, double period_s, const SmoothingWindow& window, Take take,
           VectorXd expected = {})
      : filter_(model, period_s, FrictionPrior::from_recording, step_s),
        expected_(expected.size() > 0 ? std::move(expected)
                                      : VectorXd::Zero(filter_.consider_parameters().count())),
        take_(std::move(take)),
        keep_(static_cast<std::size_t>(std::max(1.0, window.keep_s / period_s))),
        ahead_(static_cast<std::size_t>(std::max(1.0, window.ahead_s / period_s))) {}

  /// `about`: where its equations are linearised; none: the filter's own estimate. False where the
  /// time of the frame does not advance, for which there is no estimate.
  bool add(const Frame& frame, std::optional<LinearisationPoint> about = {});
  void finish() { smooth_steps(steps_.size()); }

  /// The most certain of the smoothed errors of the parameters.
  const ParameterErrors& parameter_errors() const { return errors_; }
  const std::vector<std::string>& considered() const { return filter_.considered(); }

 private:
  void time_update(KalmanFilter& filter);
  void record_readings(FilterStep& step);
  void smooth_steps(std::size_t keep);
  void step_back(const FilterStep& step, BackwardInformation& later) const;
  struct Smoothed {
    FrictionEstimate estimate;
    Vector mean;
  };
  Smoothed smoothed(const FilterStep& step, const BackwardInformation& later);
  void add_load_parameters(const Vector& mean, const MatrixXd& spread, const FilterStep& step,
                           FrictionEstimate& estimate) const;

  KalmanFilter filter_;
  VectorXd expected_;
  ParameterErrors errors_;
  Take take_;
  std::size_t keep_, ahead_;
  std::optional<LinearisationPoint> before_;  ///< of the last frame
  std::deque<FilterStep> steps_;
};

void Smoother::time_update(KalmanFilter& filter) {
  FilterStep step;
  const SparseNoise process_noise(filter.process_noise());
  filter.predict();
  step.time_update = TimeUpdate{SparseMatrix(filter.transition().dense()),
                                SparseMatrix(filter.consider_parameters().input()), process_noise,
                                SparseNoise(filter.output_noise())};
  step.predicted = filter.mean();
  step.filtered = filter.mean();  // of a missing frame
  steps_.push_back(std::move(step));
}

bool Smoother::add(const Frame& frame, std::optional<LinearisationPoint> about) {
  const FrictionEstimate& estimate = filter_.estimate();
  const std::uint64_t restarts = estimate.restarts;
  const std::size_t count = steps_.size();
  filter_.linearise_about(before_ ? &*before_ : nullptr, about ? &*about : nullptr);
  filter_.update(frame, [this](KalmanFilter& filter) { time_update(filter); });
  filter_.linearise_about(nullptr, nullptr);
  if (estimate.status == EstimateStatus::out_of_step) return false;
  before_ = std::move(about);
  if (steps_.size() == count || estimate.restarts != restarts) {
    // After a reinitialisation the states are independent of the previous ones.
    steps_.resize(count);
    steps_.emplace_back();
  }
  FilterStep& step = steps_.back();
  step.filtered = filter_.mean();
  step.covariance = packed(filter_.covariance());
  step.by_parameters = filter_.consider_parameters().sensitivity();
  step.load_by_parameters = filter_.consider_parameters().load();
  step.estimate = estimate;
  if (step.time_update) record_readings(step);
  if (steps_.size() >= keep_ + ahead_) smooth_steps(keep_);
  return true;
}

void Smoother::record_readings(FilterStep& step) {
  const unsigned used = step.estimate->innovation_valid & ~unsigned{step.estimate->refused};
  const Vector states = step.predicted;
  for (Channel channel : all_channels) {
    if (((used >> index_of(channel)) & 1U) == 0) continue;
    const KalmanFilter::PredictedReading predicted =
        filter_.predict_reading(channel, filter_.frame(), states);
    Reading reading;
    reading.innovation = filter_.frame()[channel] - predicted.value;
    reading.weight = 1.0 / std::sqrt(predicted.variance);
    for (std::size_t j = 0; j < static_cast<std::size_t>(predicted.row->count); ++j) {
      reading.by_states.emplace_back(predicted.row->state[j], predicted.row->weight[j]);
    }
    reading.by_parameters = filter_.consider_parameters().reading_errors(channel, states);
    step.readings.push_back(std::move(reading));
  }
}

// Equations of a step: those of the state after its readings, and the readings.
MatrixXd equations_after(const FilterStep& step, const BackwardInformation& later) {
  const Eigen::Index n = step.predicted.size();
  const Eigen::Index unknowns = later.root.cols();
  const auto rows = unknowns + static_cast<Eigen::Index>(step.readings.size());
  MatrixXd stack = MatrixXd::Zero(rows, unknowns + 1);
  stack.topLeftCorner(unknowns, unknowns) = later.root;
  stack.col(unknowns).head(unknowns) =
      later.value + later.root.leftCols(n) * (step.filtered - step.predicted);
  Eigen::Index next = unknowns;
  for (const Reading& reading : step.readings) {
    auto row = stack.row(next++);
    for (const auto& [state, by] : reading.by_states) row[state] += reading.weight * by;
    row.segment(n, unknowns - n) = reading.weight * reading.by_parameters.transpose();
    row[unknowns] = reading.weight * reading.innovation;
  }
  return stack;
}

// From the state after a step's readings to the state before its time update. With the noises u and
// w of unit variance it is d_after = F (d_before + G u) + H w + B p; u and w are eliminated.
void Smoother::step_back(const FilterStep& step, BackwardInformation& later) const {
  const MatrixXd after = equations_after(step, later);
  const TimeUpdate& update = *step.time_update;
  const Eigen::Index n = step.predicted.size();
  const Eigen::Index unknowns = later.root.cols();
  const Eigen::Index rows = after.rows();
  const MatrixXd h = square_root(update.output_noise.dense(n));
  const MatrixXd g = square_root(update.process_noise.dense(n));
  const Eigen::Index noises = h.cols() + g.cols();
  MatrixXd stack = MatrixXd::Zero(noises + rows, noises + unknowns + 1);
  stack.topLeftCorner(noises, noises).setIdentity();
  const auto left = after.leftCols(n);
  const MatrixXd before = left * update.jacobian.dense();
  stack.block(noises, 0, rows, h.cols()) = left * h;
  stack.block(noises, h.cols(), rows, g.cols()) = before * g;
  stack.block(noises, noises, rows, n) = before;
  stack.block(noises, noises + n, rows, unknowns - n) =
      after.middleCols(n, unknowns - n) + left * update.by_parameters.dense();
  stack.col(noises + unknowns).tail(rows) = after.col(unknowns);
  const MatrixXd reduced = triangular(stack);
  later.root = reduced.block(noises, noises, unknowns, unknowns);
  later.value = reduced.col(noises + unknowns).segment(noises, unknowns);
}

// Smooths all steps, and passes on and removes the first `keep` of them.
void Smoother::smooth_steps(std::size_t keep) {
  const auto no_information = [this] {
    const auto count = filter_.mean().size() + filter_.consider_parameters().count();
    return BackwardInformation{MatrixXd::Zero(count, count), VectorXd::Zero(count)};
  };
  BackwardInformation later = no_information();
  std::vector<Smoothed> out;
  for (std::size_t i = steps_.size(); i-- > 0;) {
    const FilterStep& step = steps_[i];
    if (step.estimate && i < keep) out.push_back(smoothed(step, later));
    if (step.time_update) {
      step_back(step, later);
    } else {
      later = no_information();
    }
  }
  for (std::size_t i = out.size(); i-- > 0;) take_(out[i].estimate, out[i].mean);
  steps_.erase(steps_.begin(), steps_.begin() + static_cast<std::ptrdiff_t>(keep));
}

// The normal load depends on consider parameters directly. `spread`: columns of states and
// parameters, whose products are their covariances.
void Smoother::add_load_parameters(const Vector& mean, const MatrixXd& spread,
                                   const FilterStep& step, FrictionEstimate& estimate) const {
  const VectorXd direct =
      spread.rightCols(step.load_by_parameters.size()) * step.load_by_parameters;
  const auto rows = filter_.rows_of(mean);
  for (std::size_t i = 0; i < estimate.used; ++i) {
    if (!rows[i].is_load) continue;
    for (std::size_t j = 0; j < estimate.used; ++j) {
      VectorXd of_row = rows[j].weight[0] * spread.col(rows[j].state[0]);
      if (rows[j].state[1] >= 0) of_row += rows[j].weight[1] * spread.col(rows[j].state[1]);
      const bool is_gamma = estimate.quantities[j] == Quantity::gamma;
      const double more = direct.dot(of_row) * (is_gamma ? estimate.gamma_per_s : 1.0);
      estimate.covariance[i][j] += more;
      estimate.covariance[j][i] += more;
    }
    estimate.covariance[i][i] += direct.squaredNorm();
  }
}

Smoother::Smoothed Smoother::smoothed(const FilterStep& step, const BackwardInformation& later) {
  FrictionEstimate estimate = *step.estimate;
  if (estimate.status == EstimateStatus::waiting) return {estimate, step.filtered};
  // Filtered and backward information combined in terms of y and p, where the deviation is
  // L y + S p and L L' + S S' the filtered covariance: |y|^2 + |p - expected|^2 +
  // |root (d, p) - value|^2 is least.
  const Eigen::Index n = step.filtered.size();
  const MatrixXd l = square_root(unpacked(step.covariance, n));
  const Eigen::Index parameters = step.by_parameters.cols();
  const Eigen::Index unknowns = l.cols() + parameters;
  MatrixXd deviation(n + parameters, unknowns);
  deviation << l, step.by_parameters, MatrixXd::Zero(parameters, l.cols()),
      MatrixXd::Identity(parameters, parameters);
  MatrixXd stack = MatrixXd::Zero(unknowns + later.root.rows(), unknowns + 1);
  stack.topLeftCorner(unknowns, unknowns).setIdentity();
  stack.col(unknowns).segment(l.cols(), parameters) = expected_;
  stack.bottomLeftCorner(later.root.rows(), unknowns) = later.root * deviation;
  stack.col(unknowns).tail(later.root.rows()) = later.value;
  const MatrixXd reduced = triangular(stack);
  const auto root =
      reduced.topLeftCorner(unknowns, unknowns).template triangularView<Eigen::Upper>();
  const VectorXd solution = root.solve(reduced.col(unknowns).head(unknowns));
  const Vector mean = step.filtered + deviation.topRows(n) * solution;
  const MatrixXd spread = root.transpose().solve(MatrixXd(deviation.transpose()));

  const double variance = spread.rightCols(parameters).squaredNorm();
  if (parameters > 0 && variance < errors_.variance) {
    errors_ = {solution.tail(parameters), variance};
  }
  Covariance covariance(static_cast<int>(n));
  for (int i = 0; i < covariance.count(); ++i) {
    for (int j = 0; j <= i; ++j) covariance.set(i, j, spread.col(i).dot(spread.col(j)));
  }
  filter_.fill_estimate(mean, covariance, nullptr, estimate);
  estimate.normal_load_n = std::max(
      0.0, estimate.normal_load_n + step.load_by_parameters.dot(solution.tail(parameters)));
  add_load_parameters(mean, spread, step, estimate);
  // Also where the filter alone was wrong; not where it was still settling, about whose states no
  // linearisation holds.
  const bool by_filter =
      estimate.status == EstimateStatus::good || estimate.status == EstimateStatus::impossible;
  if (by_filter) {
    estimate.status = is_possible(estimate) ? EstimateStatus::good : EstimateStatus::impossible;
  }
  estimate.valid = estimate.status == EstimateStatus::good;
  return {estimate, mean};
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

/// The first pass: the filter alone over the whole recording.
class FilterPass {
 public:
  FilterPass(const physics::Model& model, double period_s) : filter_(model, period_s) {
    if (!filter_.unsupported().empty()) throw std::invalid_argument(filter_.unsupported());
  }
  void add(const Frame& frame) {
    filter_.update(frame);
    means_.add(filter_.estimate());
    if (filter_.estimate().status != EstimateStatus::out_of_step) {
      count(filter_.estimate(), quality_);
    }
  }
  const ParameterMeans& means() const { return means_; }
  const PredictionQuality& quality() const { return quality_; }

 private:
  KalmanFilter filter_;
  ParameterMeans means_;
  PredictionQuality quality_;
};

/// Where the last pass is linearised: the model with other values, and their expected errors.
struct Linearisation {
  physics::Model model;
  VectorXd expected;
};

/// Smoothers at a time, each linearised about the estimates of the one before: the iterations of
/// the posterior linearisation smoother (Garcia-Fernandez, Svensson, Sarkka 2017). Where the filter
/// alone is wrong about a transition between stick and slip, so are its derivatives.
class IteratedSmoother {
 public:
  /// `take` must outlive it.
  IteratedSmoother(const Linearisation& about, double period_s, const SmoothingWindow& window,
                   const std::function<void(const FrictionEstimate&)>& take) {
    for (std::size_t i = 0; i < iterations; ++i) {
      const bool last = i + 1 == iterations;
      stages_.emplace_back(
          about.model, period_s, last ? window : short_window,
          [this, i, last, &take](const FrictionEstimate& e, const Vector& mean) {
            last ? take(e) : pass_on(i, e, mean);
          },
          about.expected);
    }
  }
  // Stages refer to it.
  IteratedSmoother(const IteratedSmoother&) = delete;
  IteratedSmoother& operator=(const IteratedSmoother&) = delete;

  void add(const Frame& frame) {
    pending_[0].push_back(frame);
    if (!stages_[0].add(frame)) pending_[0].pop_back();
  }
  void finish() {
    for (Smoother& stage : stages_) stage.finish();
  }
  const Smoother& last() const { return stages_.back(); }

 private:
  static constexpr std::size_t iterations = 2;
  static constexpr SmoothingWindow short_window{.keep_s = 2.0, .ahead_s = 2.0};

  void pass_on(std::size_t from, const FrictionEstimate& e, const Vector& mean) {
    const Frame frame = pending_[from].front();
    pending_[from].pop_front();
    if (from + 2 < iterations) pending_[from + 1].push_back(frame);
    std::optional<LinearisationPoint> about;
    if (e.valid) about = {mean, e.slip_velocity_std_m_s * e.slip_velocity_std_m_s};
    stages_[from + 1].add(frame, std::move(about));
  }

  std::deque<Smoother> stages_;
  std::array<std::deque<Frame>, iterations> pending_;  ///< not yet smoothed by that stage
};

/// The parameters' values moved by `errors` standard deviations.
Linearisation moved(const Linearisation& about, const std::vector<std::string>& paths,
                    const VectorXd& errors) {
  Linearisation out{about.model, about.expected - errors};
  for (const physics::NamedParameter& each : physics::parameters_of(out.model)) {
    const auto found = std::find(paths.begin(), paths.end(), each.path);
    if (found == paths.end()) continue;
    each.parameter->value += errors[found - paths.begin()] * each.parameter->sigma;
  }
  return out;
}

// The beginning is smoothed about the declared parameters, and again about those that it shows,
// until they stay. The first steps may overshoot, to where the linearisation is worse; errors are
// not expected beyond `farthest`.
Linearisation estimated_parameters(const physics::Model& model, double period_s,
                                   std::span<const Frame> frames) {
  constexpr double beginning_s = 10.0;
  constexpr int most_iterations = 2;
  // In standard deviations.
  constexpr double farthest = 2.5;
  constexpr double small = 0.2;
  const auto count = static_cast<std::size_t>(beginning_s / period_s);
  const auto beginning = frames.first(std::min(frames.size(), count));
  Linearisation about{model, {}};
  for (int i = 0; i < most_iterations; ++i) {
    ParameterMeans means;
    const std::function<void(const FrictionEstimate&)> take = [&](const FrictionEstimate& e) {
      means.add(e);
    };
    IteratedSmoother smoother(about, period_s, {}, take);
    for (const Frame& frame : beginning) smoother.add(frame);
    smoother.finish();
    about.model = means.apply_to(about.model);
    VectorXd errors = smoother.last().parameter_errors().mean;
    if (errors.size() == 0) break;
    if (about.expected.size() == 0) about.expected = VectorXd::Zero(errors.size());
    errors = (errors - about.expected).cwiseMax(-farthest).cwiseMin(farthest) + about.expected;
    const Linearisation next = moved(about, smoother.last().considered(), errors);
    if (!physics::inconsistencies_of(next.model).empty()) break;
    about = next;
    if (errors.cwiseAbs().maxCoeff() < small) break;
  }
  return about;
}

/// Share of the work of the filter alone.
constexpr double first_pass = 0.1;

}  // namespace

PredictionQuality smooth(const physics::Model& model, double period_s,
                         std::span<const Frame> frames,
                         const std::function<void(const FrictionEstimate&)>& take,
                         const SmoothingWindow& window,
                         const std::function<void(double share)>& progress) {
  if (!(period_s > 0.0)) throw std::invalid_argument("smooth: the period must be more than 0");
  const double count_of_frames = static_cast<double>(frames.size());
  FilterPass first(model, period_s);
  double done = 0.0;
  for (const Frame& frame : frames) {
    if (progress) progress(first_pass * done++ / count_of_frames);
    first.add(frame);
  }
  const Linearisation about = estimated_parameters(first.means().apply_to(model), period_s, frames);
  IteratedSmoother smoother(about, period_s, window, take);
  done = 0.0;
  for (const Frame& frame : frames) {
    if (progress) progress(first_pass + (1.0 - first_pass) * done++ / count_of_frames);
    smoother.add(frame);
  }
  smoother.finish();
  return first.quality();
}

}  // namespace stickslip::observer
