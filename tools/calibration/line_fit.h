// The straight line of a calibration, how sure it is, and what speaks against it.
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

/// Why a line is not to be used.
enum class Reason {
  unusable_point,  ///< not finite, or a negative uncertainty
  too_few_points,  ///< fewer than three different references
  no_span,         ///< references or readings do not differ
  scatter,         ///< the points lie further from the line than their uncertainties allow
  curvature,       ///< a parabola is better
  hysteresis,      ///< it reads differently on the way up and down
  zero_drift,      ///< the zero at the end is not that of the beginning
  gain_uncertain,  ///< the gain is not known well enough
};

/// As a calibration file says it: "zero_drift".
std::string_view name_of(Reason reason);

struct Objection {
  Reason reason = Reason::unusable_point;
  std::string sentence;  ///< what was found, and what to do
};

struct FitOptions {
  /// Share of the span of the readings below which scatter, curvature, hysteresis and drift are not
  /// held against the points, however significant: means of long readings see more than matters.
  double accuracy = 0.001;
  double significance = 0.001;       ///< what is less probable by chance is no chance
  double largest_gain_sigma = 0.02;  ///< relative standard uncertainty of the gain
  /// Relative standard uncertainty that all references have in common (local gravity).
  double scale_sigma = 0.0;
  /// Two different references are enough: a line, and nothing to hold it against.
  bool two_references = false;
  std::string unit = "SI";  ///< of the channel, for sentences
};

/// A deviation that was looked for.
struct Finding {
  double share = 0.0;    ///< its size as a share of the span of the readings
  double p_value = 1.0;  ///< probability of so much by chance
};

struct PointResidual {
  double residual_si = 0.0;  ///< reading less reference
  double chi2_share = 0.0;   ///< by how much chi-squared falls without this point
  double leverage = 0.0;     ///< 0 to 1: how much of the line's value here is this point's doing
  bool falling = false;      ///< taken on the way down
};

struct LineFit {
  bool solved = false;  ///< false: there is no line, and nothing below but the objections holds
  double offset = 0.0;  ///< [raw]
  double gain = 0.0;    ///< [SI/raw]
  config::LineCovariance covariance{};
  double coverage_95 = 1.96;  ///< standard uncertainties to either side that hold 95 %
  int degrees_of_freedom = 0;
  /// Whether every reading came with its standard deviation. If not, all are weighted alike and the
  /// scatter is taken from the residuals.
  bool weighted = false;
  std::optional<double> chi2_per_dof;  ///< weighted, and degrees of freedom left
  std::optional<double> chi2_p_value;
  bool scaled = false;  ///< the covariance was widened by chi2_per_dof, which was large (p < 5 %)
  double residual_std = 0.0;               ///< of the points about the line, SI
  std::optional<Finding> curvature;        ///< absent: too few points to tell
  std::optional<Finding> hysteresis;       ///< absent: no reference was met from both sides
  std::optional<Finding> zero_drift;       ///< absent: the smallest reference was read once
  std::optional<double> repeatability_si;  ///< absent: no reference was met twice from one side
  std::vector<PointResidual> points;
  std::vector<std::string> hints;  ///< points that decide alone, or stand apart
  std::vector<Objection> objections;

  bool acceptable() const { return solved && objections.empty(); }
};

/// Fits reading = offset + reference / gain by least squares with errors in both (York's solution;
/// points with an equal reference share its error, since it is the same weight). Points are in the
/// order in which they were taken. Never throws for what the points say.
LineFit fit(std::span<const Point> points, const FitOptions& options = {});

/// The fit as the calibration of a channel, valid from the smallest to the largest reference; date,
/// reference and by are the caller's. `despite` names the objections that there were.
config::ChannelCalibration calibration_of(const LineFit& fit, std::span<const Point> points);

}  // namespace stickslip::calibration
