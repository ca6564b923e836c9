// SPDX-License-Identifier: Apache-2.0
#include "tools/calibration/line_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <set>
#include <utility>

#include "physics/number_text.h"
#include "tools/calibration/significance.h"

namespace stickslip::calibration {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double widened_below = 0.05;  // p-value of chi-squared
constexpr double nearly_all_leverage = 0.95;
constexpr double outlier_below = 0.01;  // p-value, for as many points as there are

std::string percent(double share) { return physics::percent_text(share, 4); }

// Points scaled so that readings and references lie within -1 to 1.
struct Scaled {
  double raw_middle = 0.0;
  double raw_half = 1.0;
  double reference_middle = 0.0;
  double reference_half = 1.0;
  VectorXd reading;
  VectorXd reference;
  VectorXd reading_variance;
  MatrixXd reference_covariance;
};

struct Line {
  double at_middle = 0.0;
  double slope = 0.0;
  MatrixXd weight;      // inverse covariance of the residuals
  VectorXd residual;    // of the readings
  MatrixXd directions;  // columns: 1, the adjusted references
  Eigen::Matrix2d covariance;
  double chi2 = 0.0;
};

Scaled scaled(std::span<const Point> points, bool weighted) {
  const auto n = static_cast<Index>(points.size());
  Scaled out;
  out.reading.resize(n);
  out.reference.resize(n);
  out.reading_variance = VectorXd::Ones(n);
  out.reference_covariance = MatrixXd::Zero(n, n);
  for (Index i = 0; i < n; ++i) {
    out.reading[i] = points[static_cast<std::size_t>(i)].raw;
    out.reference[i] = points[static_cast<std::size_t>(i)].reference_si;
  }
  // Halved first: the sum of very large numbers would overflow.
  out.raw_middle = 0.5 * out.reading.maxCoeff() + 0.5 * out.reading.minCoeff();
  out.raw_half = 0.5 * out.reading.maxCoeff() - 0.5 * out.reading.minCoeff();
  out.reference_middle = 0.5 * out.reference.maxCoeff() + 0.5 * out.reference.minCoeff();
  out.reference_half = 0.5 * out.reference.maxCoeff() - 0.5 * out.reference.minCoeff();
  out.reading = (out.reading.array() - out.raw_middle) / out.raw_half;
  out.reference = (out.reference.array() - out.reference_middle) / out.reference_half;
  if (!weighted) return out;
  for (Index i = 0; i < n; ++i) {
    const Point& a = points[static_cast<std::size_t>(i)];
    out.reading_variance[i] = std::pow(a.raw_std / out.raw_half, 2);
    for (Index j = 0; j < n; ++j) {
      const Point& b = points[static_cast<std::size_t>(j)];
      if (a.reference_si != b.reference_si) continue;
      out.reference_covariance(i, j) =
          (a.reference_sigma / out.reference_half) * (b.reference_sigma / out.reference_half);
    }
  }
  return out;
}

/// York's solution: at the minimum of chi-squared the adjusted references replace the stated ones.
std::optional<Line> solve(const Scaled& points) {
  const Index n = points.reading.size();
  Line line;
  const VectorXd u = points.reference.array() - points.reference.mean();
  line.slope = u.dot(points.reading) / u.squaredNorm();
  line.at_middle = points.reading.mean() - line.slope * points.reference.mean();
  MatrixXd stated(n, 2);
  stated << VectorXd::Ones(n), points.reference;
  constexpr int most = 200;
  for (int i = 0; i < most; ++i) {
    MatrixXd covariance = line.slope * line.slope * points.reference_covariance;
    covariance.diagonal() += points.reading_variance;
    const Eigen::LDLT<MatrixXd> solver(covariance);
    line.weight = solver.solve(MatrixXd::Identity(n, n));
    line.residual = points.reading.array() - line.at_middle - line.slope * points.reference.array();
    const VectorXd pull = line.weight * line.residual;
    line.directions = stated;
    line.directions.col(1) += line.slope * points.reference_covariance * pull;
    const MatrixXd left = line.directions.transpose() * line.weight;
    const Eigen::Vector2d next = (left * stated).fullPivLu().solve(left * points.reading);
    if (!next.allFinite()) return std::nullopt;
    const double change = std::abs(next[0] - line.at_middle) + std::abs(next[1] - line.slope);
    line.at_middle = next[0];
    line.slope = next[1];
    line.covariance = (left * line.directions).inverse();
    if (change < 1.0e-14) break;
  }
  line.residual = points.reading.array() - line.at_middle - line.slope * points.reference.array();
  line.chi2 = std::max(0.0, line.residual.dot(line.weight * line.residual));
  if (!line.covariance.allFinite() || !std::isfinite(line.chi2)) return std::nullopt;
  return line;
}

/// The p-value of a deviation in standard deviations, which are first scaled by the root of
/// `excess` (chi-squared per degree of freedom of the residuals) if that is above 1 or there are no
/// weights.
double p_value_of(double deviations, double excess, int degrees_of_freedom, bool weighted) {
  if (deviations == 0.0) return 1.0;
  if (!std::isfinite(deviations)) return 0.0;
  if (degrees_of_freedom > 0 && (!weighted || excess > 1.0)) {
    return student_beyond(deviations / std::sqrt(excess), degrees_of_freedom);
  }
  return normal_beyond(deviations);
}

std::optional<Finding> curvature_of(const Line& line, const Scaled& points, bool weighted) {
  const Index n = points.reading.size();
  const int left = static_cast<int>(n) - 3;
  if (left < 0 || (!weighted && left == 0)) return std::nullopt;
  MatrixXd columns(n, 3);
  columns << line.directions, line.directions.col(1).array().square().matrix();
  const MatrixXd normal = columns.transpose() * line.weight * columns;
  const Eigen::FullPivLU<MatrixXd> solver(normal);
  if (!solver.isInvertible()) return std::nullopt;  // two references only
  const Eigen::Vector3d best = solver.solve(columns.transpose() * line.weight * points.reading);
  const VectorXd residual = points.reading - columns * best;
  const double chi2 = residual.dot(line.weight * residual);
  const double sigma = std::sqrt(solver.inverse()(2, 2));
  Finding out;
  out.share = std::abs(best[2] / (4.0 * line.slope));
  out.p_value = p_value_of(best[2] / sigma, left > 0 ? chi2 / left : 0.0, left, weighted);
  return out;
}

std::vector<bool> falling_in(std::span<const Point> points) {
  std::vector<bool> out(points.size(), false);
  for (std::size_t i = 1; i < points.size(); ++i) {
    const double step = points[i].reference_si - points[i - 1].reference_si;
    out[i] = step == 0.0 ? out[i - 1] : step < 0.0;
  }
  return out;
}

std::set<double> references_of(std::span<const Point> points) {
  std::set<double> out;
  for (const Point& point : points) out.insert(point.reference_si);
  return out;
}

struct Mean {
  double sum = 0.0;
  double variance_sum = 0.0;
  int count = 0;

  void add(const Point& point) {
    sum += point.raw;
    variance_sum += point.raw_std * point.raw_std;
    ++count;
  }
  double value() const { return sum / count; }
  double variance() const { return variance_sum / count / count; }
};

/// Difference of descending and ascending readings at the inner references.
std::optional<Finding> hysteresis_of(std::span<const Point> points,
                                     const std::vector<bool>& falling, double raw_span,
                                     bool weighted) {
  const std::set<double> references = references_of(points);
  std::vector<double> difference;
  std::vector<double> variance;
  double largest = 0.0;
  for (const double reference : references) {
    if (reference == *references.begin() || reference == *references.rbegin()) continue;
    Mean up;
    Mean down;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (points[i].reference_si == reference) (falling[i] ? down : up).add(points[i]);
    }
    if (up.count == 0 || down.count == 0) continue;
    difference.push_back(down.value() - up.value());
    variance.push_back(weighted ? up.variance() + down.variance() : 1.0);
    largest = std::max(largest, std::abs(difference.back()));
  }
  const int left = static_cast<int>(difference.size()) - 1;
  if (left < 0 || (!weighted && left == 0)) return std::nullopt;
  double weights = 0.0;
  double sum = 0.0;
  for (std::size_t i = 0; i < difference.size(); ++i) {
    weights += 1.0 / variance[i];
    sum += difference[i] / variance[i];
  }
  const double mean = sum / weights;
  double chi2 = 0.0;
  for (std::size_t i = 0; i < difference.size(); ++i) {
    chi2 += std::pow(difference[i] - mean, 2) / variance[i];
  }
  return Finding{largest / raw_span, p_value_of(mean * std::sqrt(weights),
                                                left > 0 ? chi2 / left : 0.0, left, weighted)};
}

/// Last minus first reading of the reference nearest to 0.
std::optional<Finding> zero_drift_of(std::span<const Point> points, double raw_span,
                                     std::optional<double> unweighted_variance,
                                     int degrees_of_freedom) {
  const auto nearer = [](const Point& a, const Point& b) {
    return std::abs(a.reference_si) < std::abs(b.reference_si);
  };
  const double zero = std::min_element(points.begin(), points.end(), nearer)->reference_si;
  const Point* first = nullptr;
  const Point* last = nullptr;
  for (const Point& point : points) {
    if (point.reference_si != zero) continue;
    if (first == nullptr) first = &point;
    last = &point;
  }
  if (first == last) return std::nullopt;
  const double drift = last->raw - first->raw;
  Finding out{std::abs(drift) / raw_span, 1.0};
  if (drift == 0.0) return out;
  if (unweighted_variance) {
    if (degrees_of_freedom <= 0) return std::nullopt;
    out.p_value = student_beyond(drift / std::sqrt(2.0 * *unweighted_variance), degrees_of_freedom);
  } else {
    out.p_value = normal_beyond(drift / std::hypot(first->raw_std, last->raw_std));
  }
  return out;
}

std::optional<double> repeatability_of(std::span<const Point> points,
                                       const std::vector<bool>& falling, double gain) {
  double squares = 0.0;
  int left = 0;
  for (const double reference : references_of(points)) {
    for (const bool down : {false, true}) {
      Mean mean;
      for (std::size_t i = 0; i < points.size(); ++i) {
        if (points[i].reference_si == reference && falling[i] == down) mean.add(points[i]);
      }
      if (mean.count < 2) continue;
      left += mean.count - 1;
      for (std::size_t i = 0; i < points.size(); ++i) {
        if (points[i].reference_si != reference || falling[i] != down) continue;
        squares += std::pow(points[i].raw - mean.value(), 2);
      }
    }
  }
  if (left == 0) return std::nullopt;
  return std::abs(gain) * std::sqrt(squares / left);
}

class Fit {
 public:
  Fit(std::span<const Point> points, const FitOptions& options)
      : points_(points), options_(options) {}

  LineFit run() {
    if (!usable()) return out_;
    out_.weighted = std::all_of(points_.begin(), points_.end(),
                                [](const Point& point) { return point.raw_std > 0.0; });
    const Scaled on_scale = scaled(points_, out_.weighted);
    const auto line = solve(on_scale);
    if (!line || std::abs(line->slope) < 1.0e-9) {
      object(Reason::no_span,
             "the readings do not follow the references: check the wiring, and that this is the "
             "right channel");
      return out_;
    }
    out_.solved = true;
    raw_span_ = 2.0 * on_scale.raw_half;
    unscale(*line, on_scale);
    spread();
    each_point(*line);
    test_deviations(*line, on_scale);
    object_to_deviations();
    give_hints();
    return out_;
  }

 private:
  void object(Reason reason, std::string sentence) {
    out_.objections.push_back({reason, std::move(sentence)});
  }

  std::string name(std::size_t i) const {
    return "point " + std::to_string(i + 1) + " (" +
           physics::number_text(points_[i].reference_si, 4) + " " + options_.unit + ")";
  }

  bool usable() {
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Point& point = points_[i];
      const bool finite = std::isfinite(point.raw) && std::isfinite(point.reference_si) &&
                          std::isfinite(point.raw_std) && std::isfinite(point.reference_sigma);
      if (finite && point.raw_std >= 0.0 && point.reference_sigma >= 0.0) continue;
      object(Reason::unusable_point,
             name(i) +
                 " is not a reading: its numbers must be finite and its uncertainties 0 or "
                 "more; repeat it");
      return false;
    }
    const std::size_t references = references_of(points_).size();
    if (points_.size() > 1 && references == 1) {
      object(Reason::no_span,
             "all points have the same reference: take points over the range in "
             "which the channel is used");
      return false;
    }
    const std::size_t least = options_.two_references ? 2 : 3;
    if (references < least) {
      object(Reason::too_few_points,
             "there are " + std::to_string(references) +
                 " different references; a linearity test needs at least three");
      return false;
    }
    const auto [low, high] =
        std::minmax_element(points_.begin(), points_.end(),
                            [](const Point& a, const Point& b) { return a.raw < b.raw; });
    if (low->raw == high->raw) {
      object(Reason::no_span,
             "all readings are the same, whatever the reference: check the wiring, and that this "
             "is the right channel");
      return false;
    }
    return true;
  }

  void unscale(const Line& line, const Scaled& on_scale) {
    const double sensitivity = on_scale.raw_half * line.slope / on_scale.reference_half;
    const double arm = on_scale.reference_middle / on_scale.reference_half;
    out_.offset = on_scale.raw_middle + on_scale.raw_half * (line.at_middle - arm * line.slope);
    out_.gain = 1.0 / sensitivity;
    out_.degrees_of_freedom = static_cast<int>(points_.size()) - 2;
    const double wide = widening(line);
    // Derivatives of offset and gain by the value of the line in the middle and its slope.
    Eigen::Matrix2d by;
    by << on_scale.raw_half, -on_scale.raw_half * arm, 0.0,
        -out_.gain * out_.gain * on_scale.raw_half / on_scale.reference_half;
    const Eigen::Matrix2d covariance = wide * by * line.covariance * by.transpose();
    out_.covariance = {covariance(0, 0), covariance(0, 1),
                       covariance(1, 1) + std::pow(out_.gain * options_.scale_sigma, 2)};
  }

  /// Factor on the covariance.
  double widening(const Line& line) {
    const int left = out_.degrees_of_freedom;
    if (left <= 0) return out_.weighted ? 1.0 : 0.0;
    const double excess = line.chi2 / left;
    if (!out_.weighted) {
      out_.coverage_95 = student_coverage_95(left);
      return excess;
    }
    out_.chi2_per_dof = excess;
    out_.chi2_p_value = chi_squared_beyond(line.chi2, left);
    out_.scaled = *out_.chi2_p_value < widened_below;
    if (!out_.scaled) return 1.0;
    out_.coverage_95 = student_coverage_95(left);
    return excess;
  }

  void spread() {
    out_.points.resize(points_.size());
    double squares = 0.0;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const double residual = (points_[i].raw - out_.offset) * out_.gain - points_[i].reference_si;
      out_.points[i].residual_si = residual;
      squares += residual * residual;
    }
    if (out_.degrees_of_freedom > 0)
      out_.residual_std = std::sqrt(squares / out_.degrees_of_freedom);
  }

  void each_point(const Line& line) {
    const MatrixXd weighted_directions = line.weight * line.directions;
    const MatrixXd hat = line.directions * line.covariance * weighted_directions.transpose();
    const MatrixXd left =
        line.weight - weighted_directions * line.covariance * weighted_directions.transpose();
    const VectorXd pull = line.weight * line.residual;
    const std::vector<bool> falling = falling_in(points_);
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const auto k = static_cast<Index>(i);
      PointResidual& point = out_.points[i];
      point.falling = falling[i];
      point.leverage = hat(k, k);
      const bool alone = left(k, k) <= 1.0e-9 * line.weight(k, k);
      point.chi2_share = alone ? 0.0 : pull[k] * pull[k] / left(k, k);
    }
    chi2_ = line.chi2;
  }

  void test_deviations(const Line& line, const Scaled& on_scale) {
    const std::vector<bool> falling = falling_in(points_);
    const int left = out_.degrees_of_freedom;
    out_.curvature = curvature_of(line, on_scale, out_.weighted);
    out_.hysteresis = hysteresis_of(points_, falling, raw_span_, out_.weighted);
    std::optional<double> variance;
    if (!out_.weighted) {
      variance = left > 0 ? line.chi2 / left * std::pow(on_scale.raw_half, 2) : 0.0;
    }
    out_.zero_drift = zero_drift_of(points_, raw_span_, variance, left);
    out_.repeatability_si = repeatability_of(points_, falling, out_.gain);
  }

  bool matters(const std::optional<Finding>& finding) const {
    return finding && finding->p_value < options_.significance &&
           finding->share > options_.accuracy;
  }

  void object_to_deviations() {
    const double span_si = raw_span_ * std::abs(out_.gain);
    if (out_.chi2_p_value && *out_.chi2_p_value < options_.significance &&
        out_.residual_std > options_.accuracy * span_si) {
      object(Reason::scatter,
             "the points lie " + physics::number_text(out_.residual_std, 4) + " " + options_.unit +
                 " from the line, more than their uncertainties explain (chi-squared per degree of "
                 "freedom " +
                 physics::number_text(*out_.chi2_per_dof, 4) + "): " + blamed());
    }
    if (matters(out_.curvature)) {
      object(Reason::curvature,
             "the readings bend by " + percent(out_.curvature->share) +
                 " of their span: calibrate a smaller range, or check for a stop, a clipping "
                 "amplifier or an off-axis load");
    }
    if (matters(out_.hysteresis)) {
      object(
          Reason::hysteresis,
          "ascending and descending readings differ by " + percent(out_.hysteresis->share) +
              " of the span: check for friction in the fixture and loose screws, and wait longer "
              "before each reading");
    }
    if (matters(out_.zero_drift)) {
      object(
          Reason::zero_drift,
          "the zero moved by " + percent(out_.zero_drift->share) +
              " of the span from first to last: let it warm up, check that nothing touches it, and "
              "repeat all points");
    }
    const double relative = std::sqrt(out_.covariance.gain) / std::abs(out_.gain);
    if (!(relative <= options_.largest_gain_sigma)) {
      object(Reason::gain_uncertain,
             "the gain is known to " + percent(relative) + "; " +
                 percent(options_.largest_gain_sigma) +
                 " is required: use references further apart, or average longer");
    }
  }

  std::string blamed() const {
    const auto apart = outlier();
    if (!apart) return "take longer readings of a rig at rest, and check the fixture";
    return name(*apart) + " makes up " + percent(out_.points[*apart].chi2_share / chi2_) +
           " of it: repeat that one";
  }

  /// The point without which the others are consistent with a line.
  std::optional<std::size_t> outlier() const {
    const int left = out_.degrees_of_freedom;
    if (left < 2 || chi2_ <= 0.0) return std::nullopt;
    const auto most = std::max_element(
        out_.points.begin(), out_.points.end(),
        [](const PointResidual& a, const PointResidual& b) { return a.chi2_share < b.chi2_share; });
    const double rest = std::max(0.0, chi2_ - most->chi2_share);
    const double excess = rest / (left - 1);
    const double p = p_value_of(std::sqrt(most->chi2_share), excess, left - 1, out_.weighted);
    if (p * static_cast<double>(points_.size()) >= outlier_below) return std::nullopt;
    return static_cast<std::size_t>(most - out_.points.begin());
  }

  void give_hints() {
    if (const auto apart = outlier()) {
      out_.hints.push_back(name(*apart) + " is an outlier by " +
                           physics::number_text(out_.points[*apart].residual_si, 4) + " " +
                           options_.unit + ": was it the right reference, at rest?");
    }
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (points_.size() > 3 && out_.points[i].leverage > nearly_all_leverage) {
        out_.hints.push_back(name(i) + " determines the line alone: add another near it");
      }
    }
    if (!out_.weighted) {
      out_.hints.emplace_back(
          "not every reading has a standard deviation: all have the same weight");
    }
  }

  std::span<const Point> points_;
  const FitOptions& options_;
  LineFit out_;
  double raw_span_ = 0.0;
  double chi2_ = 0.0;
};

}  // namespace

std::string_view name_of(Reason reason) {
  switch (reason) {
    case Reason::unusable_point:
      return "unusable_point";
    case Reason::too_few_points:
      return "too_few_points";
    case Reason::no_span:
      return "no_span";
    case Reason::scatter:
      return "scatter";
    case Reason::curvature:
      return "curvature";
    case Reason::hysteresis:
      return "hysteresis";
    case Reason::zero_drift:
      return "zero_drift";
    case Reason::gain_uncertain:
      return "gain_uncertain";
  }
  return "";
}

LineFit fit(std::span<const Point> points, const FitOptions& options) {
  return Fit(points, options).run();
}

config::ChannelCalibration calibration_of(const LineFit& fit, std::span<const Point> points) {
  config::ChannelCalibration out;
  out.offset = fit.offset;
  out.gain = fit.gain;
  out.covariance = fit.covariance;
  out.residual_std = fit.residual_std;
  out.points.assign(points.begin(), points.end());
  const std::set<double> references = references_of(points);
  if (references.size() > 1) {
    out.valid = config::ValidRange{*references.begin(), *references.rbegin()};
  }
  for (const Objection& each : fit.objections) out.despite.emplace_back(name_of(each.reason));
  return out;
}

}  // namespace stickslip::calibration
