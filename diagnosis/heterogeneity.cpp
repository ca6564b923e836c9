// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/heterogeneity.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <unsupported/Eigen/SpecialFunctions>

namespace stickslip::diagnosis {

namespace {

using Indices = std::vector<Eigen::Index>;

struct Line {
  Eigen::VectorXd coefficient;
  Eigen::MatrixXd covariance;
  Eigen::VectorXd distance;  // of each estimate, in standard deviations of the difference
  double q = 0.0;
  int freedom = 0;
  double p = 1.0;
};

Line line_through(const OwnEstimates& estimates, const Eigen::MatrixXd& design,
                  const Indices& members) {
  const Eigen::VectorXd value = estimates.value(members);
  const Eigen::MatrixXd covariance = estimates.covariance(members, members);
  const Eigen::MatrixXd x = design(members, Eigen::all);
  const Eigen::LDLT<Eigen::MatrixXd> factor(covariance);
  Line out;
  out.covariance =
      (x.transpose() * factor.solve(x)).ldlt().solve(Eigen::MatrixXd::Identity(x.cols(), x.cols()));
  out.coefficient = out.covariance * (x.transpose() * factor.solve(value));
  const Eigen::VectorXd left = value - x * out.coefficient;
  const Eigen::MatrixXd of_left = covariance - x * out.covariance * x.transpose();
  out.distance = left.cwiseAbs().cwiseQuotient(
      of_left.diagonal().cwiseMax(1.0e-12 * covariance.diagonal()).cwiseSqrt());
  out.q = std::max(0.0, left.dot(factor.solve(left)));
  out.freedom = static_cast<int>(members.size()) - static_cast<int>(x.cols());
  if (out.freedom > 0) out.p = Eigen::numext::igammac(0.5 * out.freedom, 0.5 * out.q);
  return out;
}

std::vector<std::size_t> as_recordings(const Indices& members) {
  return {members.begin(), members.end()};
}

// Leaves out the farthest estimate until the rest agrees.
std::vector<std::size_t> those_that_disagree(const OwnEstimates& estimates,
                                             const Eigen::MatrixXd& design, const Indices& all,
                                             double level) {
  Indices rest = all;
  Indices out;
  for (;;) {
    const Line line = line_through(estimates, design, rest);
    if (line.freedom < 1) return as_recordings(all);
    if (line.p >= level / static_cast<double>(all.size())) return as_recordings(out);
    Eigen::Index farthest = 0;
    line.distance.maxCoeff(&farthest);
    out.push_back(rest[static_cast<std::size_t>(farthest)]);
    rest.erase(rest.begin() + farthest);
  }
}

// Twice the negative restricted log-likelihood of a spread.
double deviance(const OwnEstimates& estimates, double spread, Line& line) {
  OwnEstimates widened = estimates;
  widened.covariance.diagonal().array() += spread * spread;
  Indices all(static_cast<std::size_t>(estimates.value.size()));
  std::iota(all.begin(), all.end(), Eigen::Index{0});
  line = line_through(widened, common_design(estimates.value.size()), all);
  const Eigen::VectorXd pivots = widened.covariance.ldlt().vectorD();
  return pivots.array().max(1.0e-300).log().sum() - std::log(line.covariance(0, 0)) + line.q;
}

}  // namespace

Eigen::MatrixXd common_design(Eigen::Index recordings) {
  return Eigen::MatrixXd::Ones(recordings, 1);
}

Heterogeneity heterogeneity_of(const OwnEstimates& estimates, const Eigen::MatrixXd& design,
                               double level) {
  Indices all(static_cast<std::size_t>(estimates.value.size()));
  std::iota(all.begin(), all.end(), Eigen::Index{0});
  const Line line = line_through(estimates, design, all);
  Heterogeneity out{line.coefficient, line.covariance, line.q, line.freedom, line.p, {}};
  if (out.freedom > 0 && out.p < level) {
    out.disagreeing = those_that_disagree(estimates, design, all, level);
  }
  return out;
}

Spread spread_of(const OwnEstimates& estimates) {
  constexpr double chi_squared_95 = 3.841459;  // of one degree of freedom
  constexpr int steps = 400;
  Spread out;
  if (estimates.value.size() < 2) return out;
  const double error = std::sqrt(estimates.covariance.diagonal().minCoeff());
  const double range = estimates.value.maxCoeff() - estimates.value.minCoeff();
  // From far below the errors to where even two recordings exclude it.
  const double least = 1.0e-2 * std::min(error, std::max(range, 1.0e-3 * error));
  const double most = 100.0 * std::max(range, error);
  Line line;
  std::vector<double> tried{0.0};
  for (int i = 0; i <= steps; ++i)
    tried.push_back(least * std::pow(most / least, i / (1.0 * steps)));
  std::vector<double> found;
  for (const double each : tried) found.push_back(deviance(estimates, each, line));
  const auto best = std::min_element(found.begin(), found.end());
  out.value = tried[static_cast<std::size_t>(best - found.begin())];
  const auto inside = [&](double each) { return each <= *best + chi_squared_95; };
  const auto first = std::find_if(found.begin(), found.end(), inside) - found.begin();
  const auto last = found.rend() - std::find_if(found.rbegin(), found.rend(), inside) - 1;
  out.low = tried[static_cast<std::size_t>(first)];
  out.high = tried[static_cast<std::size_t>(last)];
  deviance(estimates, out.value, line);
  out.mean = line.coefficient[0];
  out.mean_error = std::sqrt(line.covariance(0, 0));
  return out;
}

}  // namespace stickslip::diagnosis
