// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/nuisance_projection.h"

namespace stickslip::diagnosis {

NuisanceProjection::NuisanceProjection(const Hypothesis& hypothesis, std::span<const double> z,
                                       std::vector<WindowJacobian> windows)
    : windows_(std::move(windows)) {
  const auto np = static_cast<Eigen::Index>(hypothesis.unknowns().size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(np, np);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(np);
  for (WindowJacobian& w : windows_) {
    // A window in which the model diverged says nothing.
    if (!w.residual.allFinite() || !w.parameters.allFinite() || !w.free.allFinite()) {
      w.residual.setZero();
      w.parameters.setZero();
      w.free.setZero();
    }
    Eigen::MatrixXd own = w.free.transpose() * w.free;
    own.diagonal().array() += 1.0;  // free columns are in units of their priors
    own_.emplace_back(own);
    cross_.push_back(w.free.transpose() * w.parameters);
    const Eigen::VectorXd own_gradient = w.free.transpose() * w.residual;
    const Eigen::MatrixXd solved = own_.back().solve(cross_.back());
    information += w.parameters.transpose() * w.parameters - cross_.back().transpose() * solved;
    gradient += w.parameters.transpose() * w.residual - solved.transpose() * own_gradient;
  }
  for (Eigen::Index i = 0; i < np; ++i) {
    const auto u = static_cast<std::size_t>(i);
    const double sigma = hypothesis.unknowns()[u].prior_sigma;
    if (sigma > 0.0) {
      information(i, i) += 1.0 / (sigma * sigma);
      gradient[i] += z[u] / (sigma * sigma);
    }
    information(i, i) += 1.0e-12 * (1.0 + information(i, i));
  }
  common_.compute(information);
  const Eigen::VectorXd step = common_.solve(gradient);
  for (std::size_t w = 0; w < windows_.size(); ++w) {
    const WindowJacobian& j = windows_[w];
    const Eigen::VectorXd left = j.residual - j.parameters * step;
    unabsorbed_.push_back(left - j.free * own_[w].solve(j.free.transpose() * left));
  }
}

double NuisanceProjection::samples() const {
  double sum = 0.0;
  for (const WindowJacobian& w : windows_) sum += static_cast<double>(w.residual.size());
  return sum;
}

double NuisanceProjection::product(const Change& a, const Change& b) const {
  double sum = 0.0;
  Eigen::VectorXd ga = Eigen::VectorXd::Zero(common_.rows());
  Eigen::VectorXd gb = ga;
  for (std::size_t w = 0; w < windows_.size(); ++w) {
    const WindowJacobian& j = windows_[w];
    const Eigen::VectorXd own_a = j.free.transpose() * a[w];
    const Eigen::VectorXd solved = own_[w].solve(j.free.transpose() * b[w]);
    sum += a[w].dot(b[w]) - own_a.dot(solved);
    ga += j.parameters.transpose() * a[w] - cross_[w].transpose() * own_[w].solve(own_a);
    gb += j.parameters.transpose() * b[w] - cross_[w].transpose() * solved;
  }
  return sum - ga.dot(common_.solve(gb));
}

double NuisanceProjection::slope(const Change& change) const {
  double sum = 0.0;
  for (std::size_t w = 0; w < windows_.size(); ++w) sum += unabsorbed_[w].dot(change[w]);
  return sum;
}

Change change_by(const Hypothesis& with, const Task& task, const FittedHypothesis& base,
                 const NuisanceProjection& projection) {
  std::vector<double> z(base.z.begin(), base.z.end());
  z.resize(with.unknowns().size(), 0.0);  // terms come last
  const std::vector<WindowState> state =
      warm_start_states(*base.state, task, *base.hypothesis, with);
  Change change;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    change.push_back(residuals_of(task, w, with, z, state[w]) - projection.residual(w));
    if (!change.back().allFinite()) change.back().setConstant(1.0e6);
  }
  return change;
}

}  // namespace stickslip::diagnosis
