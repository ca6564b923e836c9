// SPDX-License-Identifier: Apache-2.0
#include "daemon/drive_file.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "daemon/recording_input.h"
#include "physics/number_text.h"
#include "physics/problem.h"

namespace stickslip::daemon {
namespace {

constexpr std::size_t min_samples = 4;

/// Solves a symmetric tridiagonal system in place; `off[i]` couples rows i and i + 1.
void solve_tridiagonal(std::vector<double> diagonal, const std::vector<double>& off,
                       std::vector<double>& right) {
  const std::size_t n = diagonal.size();
  for (std::size_t i = 1; i < n; ++i) {
    const double factor = off[i - 1] / diagonal[i - 1];
    diagonal[i] -= factor * off[i - 1];
    right[i] -= factor * right[i - 1];
  }
  right[n - 1] /= diagonal[n - 1];
  for (std::size_t i = n - 1; i > 0; --i) {
    right[i - 1] = (right[i - 1] - off[i - 1] * right[i]) / diagonal[i - 1];
  }
}

/// Second derivatives at the knots of the natural spline, zero at the ends.
std::vector<double> natural_curvatures(const std::vector<double>& t, const std::vector<double>& u) {
  const std::size_t inner = t.size() - 2;
  std::vector<double> diagonal(inner);
  std::vector<double> off(inner);
  std::vector<double> right(inner);
  for (std::size_t i = 0; i < inner; ++i) {
    const double before = t[i + 1] - t[i];
    const double after = t[i + 2] - t[i + 1];
    diagonal[i] = 2.0 * (before + after);
    off[i] = after;
    right[i] = 6.0 * ((u[i + 2] - u[i + 1]) / after - (u[i + 1] - u[i]) / before);
  }
  solve_tridiagonal(std::move(diagonal), off, right);
  right.insert(right.begin(), 0.0);
  right.push_back(0.0);
  return right;
}

/// Second derivatives of the periodic spline. The corner elements of the cyclic matrix are treated
/// as a rank-one update, by the Sherman-Morrison formula.
std::vector<double> periodic_curvatures(const std::vector<double>& t,
                                        const std::vector<double>& u) {
  const std::size_t n = t.size() - 1;  // the last knot equals the first
  std::vector<double> diagonal(n);
  std::vector<double> off(n);
  std::vector<double> right(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t previous = i == 0 ? n - 1 : i - 1;
    const double before = t[previous + 1] - t[previous];
    const double after = t[i + 1] - t[i];
    diagonal[i] = 2.0 * (before + after);
    off[i] = after;
    right[i] = 6.0 * ((u[i + 1] - u[i]) / after - (u[previous + 1] - u[previous]) / before);
  }
  const double corner = off[n - 1];
  const double shift = -diagonal[0];
  std::vector<double> unit(n, 0.0);
  unit[0] = shift;
  unit[n - 1] = corner;
  diagonal[0] -= shift;
  diagonal[n - 1] -= corner * corner / shift;
  solve_tridiagonal(diagonal, off, right);
  solve_tridiagonal(diagonal, off, unit);
  const double weight =
      (right[0] + corner * right[n - 1] / shift) / (1.0 + unit[0] + corner * unit[n - 1] / shift);
  for (std::size_t i = 0; i < n; ++i) right[i] -= weight * unit[i];
  right.push_back(right[0]);
  return right;
}

}  // namespace

DriveFile::DriveFile(std::vector<double> times_s, std::vector<double> values, bool periodic,
                     const std::string& name)
    : times_s_(std::move(times_s)), values_(std::move(values)) {
  if (times_s_.size() < min_samples) {
    throw InputError(Problem{
        name, 0, 0,
        "has " + physics::counted(times_s_.size(), "sample") + ": a drive needs 4 or more"});
  }
  const double origin = times_s_.front();
  for (double& time : times_s_) time -= origin;
  if (periodic) {
    const auto [low, high] = std::minmax_element(values_.begin(), values_.end());
    if (std::abs(values_.back() - values_.front()) > 1e-6 * (*high - *low)) {
      throw InputError(Problem{
          name, 0, 0,
          "begins at " + config::short_number(values_.front()) + " and ends at " +
              config::short_number(values_.back()) +
              ": a drive that repeats must end at its first value; or set excitation.file.at_end = "
              "\"ramp_down\""});
    }
    values_.back() = values_.front();
  }
  curvatures_ =
      periodic ? periodic_curvatures(times_s_, values_) : natural_curvatures(times_s_, values_);
}

DriveFile DriveFile::load(const config::DriveFile& settings, Channel channel) {
  const protocol::Recording recording = recording_from(settings.path);
  const std::string name = settings.path.string();
  std::vector<double> times_s;
  std::vector<double> values;
  times_s.reserve(recording.frames.size());
  values.reserve(recording.frames.size());
  const std::string column(info(channel).column);
  for (const Frame& frame : recording.frames) {
    if (!frame.has(channel)) {
      throw InputError(Problem{
          name, 0, 0,
          times_s.empty() ? "has no " + column + ": expected the columns time_s, " + column
                          : "has no " + column + " at " + config::short_number(frame.time_s()) +
                                " s: a drive has no gaps"});
    }
    times_s.push_back(static_cast<double>(frame.time_ns - recording.frames.front().time_ns) * 1e-9);
    values.push_back(frame[channel]);
  }
  return {std::move(times_s), std::move(values), settings.at_end == config::DriveFileEnd::repeat,
          name};
}

double DriveFile::at(double time_s) {
  if (times_s_.empty()) return 0.0;
  const double t = std::clamp(time_s, 0.0, times_s_.back());
  // Usually the same interval or the next; otherwise a search.
  if (t < times_s_[piece_] || (piece_ + 2 < times_s_.size() && t > times_s_[piece_ + 2])) {
    const auto after = std::upper_bound(times_s_.begin() + 1, times_s_.end() - 1, t);
    piece_ = static_cast<std::size_t>(after - times_s_.begin()) - 1;
  } else if (piece_ + 2 < times_s_.size() && t > times_s_[piece_ + 1]) {
    ++piece_;
  }
  const double length = times_s_[piece_ + 1] - times_s_[piece_];
  const double b = (t - times_s_[piece_]) / length;
  const double a = 1.0 - b;
  return a * values_[piece_] + b * values_[piece_ + 1] +
         ((a * a * a - a) * curvatures_[piece_] + (b * b * b - b) * curvatures_[piece_ + 1]) *
             length * length / 6.0;
}

config::Demand DriveFile::demand(double period_s) {
  config::Demand out;
  double before = 0.0;
  double two_before = 0.0;
  const auto samples = static_cast<std::size_t>(length_s() / period_s) + 1;
  for (std::size_t i = 0; i < samples; ++i) {
    const double now = at(static_cast<double>(i) * period_s);
    out.displacement = std::max(out.displacement, std::abs(now));
    if (i >= 1) out.velocity = std::max(out.velocity, std::abs(now - before) / period_s);
    if (i >= 2) {
      out.acceleration = std::max(
          out.acceleration, std::abs(now - 2.0 * before + two_before) / (period_s * period_s));
    }
    two_before = before;
    before = now;
  }
  return out;
}

}  // namespace stickslip::daemon
