// SPDX-License-Identifier: Apache-2.0
#include "tools/calibration/words.h"

#include <algorithm>
#include <cmath>

#include "physics/number_text.h"

namespace stickslip::calibration {

namespace {

std::string padded(const std::string& text, std::size_t width) {
  return std::string(width - std::min(width, text.size()), ' ') + text;
}

std::string long_number(double value) { return physics::number_text(value, 7); }

std::string percent(double share) { return physics::percent_text(share, 4); }

/// "value +- sigma unit (0.1 %)"; without an unknown sigma.
std::string with_sigma(double value, double sigma, const std::string& unit, bool relative) {
  std::string text = long_number(value);
  if (sigma > 0.0) text += " +- " + short_number(sigma);
  if (!unit.empty()) text += " " + unit;
  if (sigma > 0.0 && relative && value != 0.0)
    text += " (" + percent(sigma / std::abs(value)) + ")";
  return text;
}

std::string per(const std::string& unit, const std::string& raw_unit) {
  const std::string below = raw_unit.empty() ? "raw" : raw_unit;
  return unit + (below.find('/') == std::string::npos ? "/" + below : "/(" + below + ")");
}

/// A smaller probability than this is no better known than the distribution's tail.
std::string p_text(double p) {
  constexpr double least = 1.0e-4;
  return p < least ? "p < " + short_number(least) : "p = " + short_number(p);
}

void say(std::string& out, const char* what, const std::string& text) {
  std::string line = "  ";
  line += what;
  line.resize(std::max<std::size_t>(line.size() + 1, 18), ' ');
  out += line + text + "\n";
}

void say(std::string& out, const char* what, const std::optional<Finding>& finding) {
  say(out, what,
      finding ? percent(finding->share) + " of the span, " + p_text(finding->p_value)
              : std::string("not testable with these points"));
}

}  // namespace

std::string short_number(double value) { return physics::number_text(value, 4); }

std::string fit_text(const LineFit& fit, std::span<const Point> points, Channel channel,
                     const std::string& raw_unit) {
  const std::string unit(info(channel).unit);
  std::string out;
  if (fit.solved) {
    out += "  point     reference [" + unit + "]           reading    residual [" + unit + "]\n";
    for (std::size_t i = 0; i < points.size(); ++i) {
      out += padded(std::to_string(i + 1), 7) + padded(long_number(points[i].reference_si), 18) +
             padded(long_number(points[i].raw), 18) +
             padded(short_number(fit.points[i].residual_si), 17) +
             (fit.points[i].falling ? "  down" : "  up") + "\n";
    }
    say(out, "offset", with_sigma(fit.offset, std::sqrt(fit.covariance.offset), raw_unit, false));
    say(out, "gain",
        with_sigma(fit.gain, std::sqrt(fit.covariance.gain), per(unit, raw_unit), true));
    say(out, "95 % within",
        short_number(fit.coverage_95) + " standard uncertainties" +
            (fit.scaled ? ", which are scaled by the observed scatter" : ""));
    say(out, "residuals",
        short_number(fit.residual_std) + " " + unit +
            (fit.chi2_per_dof
                 ? ", chi-squared per degree of freedom " + short_number(*fit.chi2_per_dof) + " (" +
                       p_text(*fit.chi2_p_value) + ")"
                 : std::string()));
    say(out, "curvature", fit.curvature);
    say(out, "hysteresis", fit.hysteresis);
    say(out, "zero drift", fit.zero_drift);
    say(out, "repeatability",
        fit.repeatability_si ? short_number(*fit.repeatability_si) + " " + unit
                             : std::string("not testable with these points"));
  }
  for (const std::string& hint : fit.hints) say(out, "hint", hint);
  for (const Objection& each : fit.objections) say(out, "REFUSED", each.sentence);
  return out;
}

std::string change_text(const std::optional<config::ChannelCalibration>& before,
                        const config::ChannelCalibration& after, Channel channel) {
  const std::string unit(info(channel).unit);
  std::string out;
  if (!before) {
    say(out, "before", "none");
  } else {
    say(out, "before", calibration_words(*before, channel));
  }
  say(out, "after", calibration_words(after, channel));
  if (!before || after.points.empty()) return out;
  double largest = 0.0;
  double at = 0.0;
  for (const Point& point : after.points) {
    const double was = (point.raw - before->offset) * before->gain;
    const double is = (point.raw - after.offset) * after.gain;
    if (std::abs(is - was) < std::abs(largest)) continue;
    largest = is - was;
    at = is;
  }
  const double sigma =
      std::hypot(config::calibration_sigma(after, at), config::calibration_sigma(*before, at));
  say(out, "difference",
      "up to " + short_number(largest) + " +- " + short_number(sigma) + " " + unit + ", at " +
          short_number(at) + " " + unit);
  return out;
}

std::string calibration_words(const config::ChannelCalibration& calibration, Channel channel) {
  const std::string unit(info(channel).unit);
  std::string out = "offset " +
                    with_sigma(calibration.offset, std::sqrt(calibration.covariance.offset),
                               calibration.raw_unit, false) +
                    ", gain " +
                    with_sigma(calibration.gain, std::sqrt(calibration.covariance.gain),
                               per(unit, calibration.raw_unit), true);
  if (!calibration.date.empty()) out += ", " + calibration.date;
  if (!calibration.reference.empty()) out += ", against " + calibration.reference;
  if (!calibration.by.empty()) out += ", by " + calibration.by;
  for (const std::string& each : calibration.despite) out += ", despite " + each;
  return out;
}

}  // namespace stickslip::calibration
