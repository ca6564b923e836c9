// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/nuisance_projection.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <utility>

#include "diagnosis/window_problem.h"

namespace stickslip::diagnosis {

namespace {

// Share of a change's square that has to be left where all else has adapted to it.
constexpr double least_independent_share = 1.0e-9;

// The solution of `square` x = `right`, without the directions in which `square`, scaled to a
// diagonal of 1, is singular.
Eigen::VectorXd solved(const Eigen::MatrixXd& square, const Eigen::VectorXd& raw,
                       const Eigen::VectorXd& right) {
  if (!square.allFinite() || !right.allFinite()) return Eigen::VectorXd::Zero(right.size());
  const Eigen::VectorXd scale =
      raw.unaryExpr([](double x) { return x > 0.0 ? 1.0 / std::sqrt(x) : 0.0; });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * square *
                                                             scale.asDiagonal());
  const Eigen::VectorXd inverse = eigen.eigenvalues().unaryExpr(
      [](double x) { return x > least_independent_share ? 1.0 / x : 0.0; });
  return scale.asDiagonal() * (eigen.eigenvectors() * inverse.asDiagonal() *
                               eigen.eigenvectors().transpose() * (scale.asDiagonal() * right));
}

}  // namespace

std::vector<double> robust_weights(const std::vector<WindowJacobian>& windows) {
  std::vector<double> out;
  for (const WindowJacobian& w : windows) {
    const double chi2 = w.residual.squaredNorm();
    out.push_back(std::isfinite(chi2) ? robust_weight(chi2, static_cast<int>(w.residual.size()))
                                      : 1.0);
  }
  return out;
}

NuisanceProjection::NuisanceProjection(const Hypothesis& hypothesis, std::span<const double> z,
                                       std::vector<WindowJacobian> windows, Options options)
    : windows_(std::move(windows)), weight_(std::move(options.weight)), damping_(options.damping) {
  weight_.resize(windows_.size(), 1.0);
  const auto np = static_cast<Eigen::Index>(hypothesis.unknowns().size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(np, np);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(np);
  std::vector<Eigen::VectorXd> own_gradient;
  for (std::size_t i = 0; i < windows_.size(); ++i) {
    WindowJacobian& w = windows_[i];
    // A window in which the model diverged says nothing.
    if (!w.residual.allFinite() || !w.parameters.allFinite() || !w.free.allFinite()) {
      w.residual.setZero();
      w.parameters.setZero();
      w.free.setZero();
    }
    Eigen::MatrixXd own = weight_[i] * (w.free.transpose() * w.free);
    own.diagonal().array() += 1.0;  // free columns are in units of their priors
    own.diagonal() *= 1.0 + damping_;
    own_.emplace_back(own);
    cross_.push_back(weight_[i] * (w.free.transpose() * w.parameters));
    own_gradient.push_back(weight_[i] * (w.free.transpose() * w.residual) + w.offset);
    const Eigen::MatrixXd adapted = own_.back().solve(cross_.back());
    const Eigen::MatrixXd square = weight_[i] * (w.parameters.transpose() * w.parameters);
    information += square - cross_.back().transpose() * adapted;
    information.diagonal() += damping_ * square.diagonal();
    gradient += weight_[i] * (w.parameters.transpose() * w.residual) -
                adapted.transpose() * own_gradient.back();
  }
  for (Eigen::Index i = 0; i < np; ++i) {
    const auto u = static_cast<std::size_t>(i);
    const double sigma = hypothesis.unknowns()[u].prior_sigma;
    if (sigma > 0.0) {
      information(i, i) += (1.0 + damping_) / (sigma * sigma);
      gradient[i] += z[u] / (sigma * sigma);
    }
    information(i, i) += 1.0e-12 * (1.0 + information(i, i));
  }
  common_.compute(information);
  step_ = -common_.solve(gradient);
  for (std::size_t w = 0; w < windows_.size(); ++w) {
    const WindowJacobian& j = windows_[w];
    own_step_.push_back(-own_[w].solve(own_gradient[w] + cross_[w] * step_));
    unabsorbed_.push_back(j.residual + j.parameters * step_ + j.free * own_step_.back());
  }
}

double NuisanceProjection::samples() const {
  double sum = 0.0;
  for (const WindowJacobian& w : windows_) sum += static_cast<double>(w.residual.size());
  return sum;
}

NuisanceProjection::Reduced NuisanceProjection::reduced(std::size_t w,
                                                        const Eigen::MatrixXd& changes) const {
  const WindowJacobian& j = windows_[w];
  Reduced out;
  out.own = weight_[w] * (j.free.transpose() * changes);
  out.solved = own_[w].solve(out.own);
  out.gradient =
      weight_[w] * (j.parameters.transpose() * changes) - cross_[w].transpose() * out.solved;
  return out;
}

double NuisanceProjection::product(const Change& a, const Change& b) const {
  double sum = 0.0;
  Eigen::VectorXd ga = Eigen::VectorXd::Zero(common_.rows());
  Eigen::VectorXd gb = ga;
  for (std::size_t w = 0; w < windows_.size(); ++w) {
    const Reduced of_a = reduced(w, a[w]);
    const Reduced of_b = reduced(w, b[w]);
    sum += weight_[w] * a[w].dot(b[w]) - of_a.own.col(0).dot(of_b.solved.col(0));
    ga += of_a.gradient;
    gb += of_b.gradient;
  }
  return sum - ga.dot(common_.solve(gb));
}

double NuisanceProjection::slope(const Change& change) const {
  double sum = 0.0;
  for (std::size_t w = 0; w < windows_.size(); ++w) {
    sum += weight_[w] * unabsorbed_[w].dot(change[w]);
  }
  return sum;
}

Response NuisanceProjection::response_to(std::span<const Change> changes) const {
  const auto count = static_cast<Eigen::Index>(changes.size());
  Eigen::MatrixXd square = Eigen::MatrixXd::Zero(count, count);
  Eigen::VectorXd raw = Eigen::VectorXd::Zero(count);
  Eigen::VectorXd slopes = Eigen::VectorXd::Zero(count);
  Eigen::MatrixXd gradient = Eigen::MatrixXd::Zero(common_.rows(), count);
  std::vector<Reduced> all;
  for (std::size_t w = 0; w < windows_.size(); ++w) {
    Eigen::MatrixXd columns(windows_[w].residual.size(), count);
    for (Eigen::Index i = 0; i < count; ++i)
      columns.col(i) = changes[static_cast<std::size_t>(i)][w];
    all.push_back(reduced(w, columns));
    square += weight_[w] * (columns.transpose() * columns) -
              all.back().own.transpose() * all.back().solved;
    raw += weight_[w] * columns.colwise().squaredNorm().transpose();
    slopes += weight_[w] * (columns.transpose() * unabsorbed_[w]);
    gradient += all.back().gradient;
  }
  square -= gradient.transpose() * common_.solve(gradient);
  square.diagonal() += damping_ * raw;
  Response out;
  out.size = count > 0 ? Eigen::VectorXd(-solved(square, raw, slopes)) : slopes;
  out.gain = -out.size.dot(slopes);
  const Eigen::VectorXd beyond = -common_.solve(gradient * out.size);
  out.parameters = step_ + beyond;
  for (std::size_t w = 0; w < windows_.size(); ++w) {
    out.free.push_back(own_step_[w] - all[w].solved * out.size - own_[w].solve(cross_[w] * beyond));
  }
  return out;
}

Change change_by(const Hypothesis& with, const Task& task, const FittedHypothesis& base,
                 const NuisanceProjection& projection) {
  std::vector<double> z(base.z.begin(), base.z.end());
  z.resize(with.unknowns().size(), 0.0);  // terms come last
  const std::vector<WindowState> state =
      warm_start_states(*base.state, task, *base.hypothesis, with);
  const WindowProblem problem(task, with, z, true);
  Change change;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    change.push_back(problem.residual(w, state[w]) - projection.residual(w));
    if (!change.back().allFinite()) change.back().setConstant(1.0e6);
  }
  return change;
}

}  // namespace stickslip::diagnosis
