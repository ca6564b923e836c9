// SPDX-License-Identifier: Apache-2.0
// The straight line of a calibration, its uncertainty, and objections to it.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/calibration.h"

namespace stickslip::calibration {

using Point = config::CalibrationPoint;

/// Reasons not to use a line.
enum class Reason {
  unusable_point,  ///< not finite, or a negative uncertainty
  too_few_points,  ///< fewer than three different references
  no_span,         ///< references or readings do not differ
  scatter,         ///< residuals larger than the uncertainties of the points
  curvature,       ///< a parabola fits significantly better
  hysteresis,      ///< ascending and descending readings differ
  zero_drift,      ///< the zeros at beginning and end differ
  gain_uncertain,  ///< the uncertainty of the gain is too large
};

/// The name in calibration files: "zero_drift".
std::string_view name_of(Reason reason);

struct Objection {
  Reason reason = Reason::unusable_point;
  std::string sentence;  ///< observation and remedy
};

struct FitOptions {
  /// Share of the span of the readings below which scatter, curvature, hysteresis and drift are
  /// tolerated even if significant: means of long readings resolve more than matters.
  double accuracy = 0.001;
  double significance = 0.001;       ///< level of the tests (p-value)
  double largest_gain_sigma = 0.02;  ///< relative standard uncertainty of the gain
  /// Relative standard uncertainty common to all references (local gravity).
  double scale_sigma = 0.0;
  /// Accept two different references: a line that cannot be tested.
  bool two_references = false;
  std::string unit = "SI";  ///< of the channel, for sentences
};

/// A tested deviation from the line.
struct Finding {
  double share = 0.0;    ///< its size as a share of the span of the readings
  double p_value = 1.0;  ///< probability of such a size by chance
};

struct PointResidual {
  double residual_si = 0.0;  ///< reading less reference
  double chi2_share = 0.0;   ///< decrease of chi-squared without this point
  double leverage = 0.0;     ///< influence of the point on the line, 0 to 1
  bool falling = false;      ///< taken while descending
};

struct LineFit {
  bool solved = false;  ///< false: no line; of the rest only the objections are set
  double offset = 0.0;  ///< [raw]
  double gain = 0.0;    ///< [SI/raw]
  config::LineCovariance covariance{};
  double coverage_95 = 1.96;  ///< coverage factor of the 95 % interval
  int degrees_of_freedom = 0;
  /// True if every reading has a standard deviation. Otherwise all have the same weight and the
  /// scatter is estimated from the residuals.
  bool weighted = false;
  std::optional<double> chi2_per_dof;  ///< only if weighted, with degrees of freedom left
  std::optional<double> chi2_p_value;
  bool scaled = false;        ///< covariance scaled by chi2_per_dof, which was large (p < 5 %)
  double residual_std = 0.0;  ///< of the points about the line, SI
  std::optional<Finding> curvature;   ///< absent: too few points
  std::optional<Finding> hysteresis;  ///< absent: no reference was approached from both sides
  std::optional<Finding> zero_drift;  ///< absent: the smallest reference was read once
  std::optional<double>
      repeatability_si;  ///< absent: no reference was approached twice from one side
  std::vector<PointResidual> points;
  std::vector<std::string> hints;  ///< influential points and outliers
  std::vector<Objection> objections;

  bool acceptable() const { return solved && objections.empty(); }
};

/// Fits reading = offset + reference / gain by least squares with errors in both (York's solution;
/// points with an equal reference share its error, since it is the same weight). Points are in the
/// order of measurement. Does not throw, whatever the points.
LineFit fit(std::span<const Point> points, const FitOptions& options = {});

/// The fit as the calibration of a channel, valid from the smallest to the largest reference; date,
/// reference and by are left to the caller. `despite` lists the objections.
config::ChannelCalibration calibration_of(const LineFit& fit, std::span<const Point> points);

}  // namespace stickslip::calibration
