// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/number_scores.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace stickslip::diagnosis {

namespace {

// Normal equations of parameters, the free numbers of the windows eliminated.
struct Equations {
  Eigen::MatrixXd information;
  Eigen::VectorXd gradient;
};

Equations reduced(const std::vector<WindowJacobian>& windows, std::size_t unknowns) {
  const auto np = static_cast<Eigen::Index>(unknowns);
  Equations out{Eigen::MatrixXd::Zero(np, np), Eigen::VectorXd::Zero(np)};
  for (const WindowJacobian& w : windows) {
    if (!w.residual.allFinite() || !w.parameters.allFinite() || !w.free.allFinite()) continue;
    const double weight =
        robust_weight(w.residual.squaredNorm(), static_cast<int>(w.residual.size()));
    Eigen::MatrixXd own = w.free.transpose() * w.free;
    own.diagonal().array() += 1.0;  // free columns are in units of their priors
    const Eigen::MatrixXd cross = w.free.transpose() * w.parameters;
    const Eigen::MatrixXd solved = own.llt().solve(cross);
    out.information +=
        weight * (w.parameters.transpose() * w.parameters - cross.transpose() * solved);
    out.gradient += weight * (w.parameters.transpose() * w.residual -
                              solved.transpose() * (w.free.transpose() * w.residual));
  }
  return out;
}

// Decrease of the quadratic cost by the best step of these unknowns.
double gain_of(const Equations& all, const std::vector<Eigen::Index>& members) {
  const Eigen::MatrixXd information = all.information(members, members);
  const Eigen::VectorXd gradient = all.gradient(members);
  return gradient.dot(information.ldlt().solve(gradient));
}

// The prior of a base's unknown in the units of the same number in `joint`.
void add_prior(Equations& all, const FittedCandidate& base, std::size_t unknown,
               const Hypothesis& joint, std::size_t in_joint, double z, double sign) {
  const Unknown& declared = base.hypothesis->unknowns()[unknown];
  if (!(declared.prior_sigma > 0.0)) return;
  const double ratio =
      joint.slope(in_joint, z) /
      (base.hypothesis->slope(unknown, base.fitted.z[unknown]) * declared.prior_sigma);
  const auto i = static_cast<Eigen::Index>(in_joint);
  all.information(i, i) += sign * ratio * ratio;
  all.gradient[i] += sign * ratio * base.fitted.z[unknown] / declared.prior_sigma;
}

// The same part of the same number, or the number where that is freed.
std::size_t same_in(const Hypothesis& joint, const Unknown& unknown) {
  const auto& all = joint.unknowns();
  const auto found = std::find_if(all.begin(), all.end(), [&](const Unknown& each) {
    return each.parameter == unknown.parameter && each.part == unknown.part &&
           each.recording == unknown.recording;
  });
  if (found != all.end()) return static_cast<std::size_t>(found - all.begin());
  return joint.unknown_of(unknown.parameter).value();
}

std::size_t unknown_at(const Hypothesis& hypothesis, const std::string& path) {
  const auto& paths = hypothesis.rig().parameter_paths();
  const auto at = std::find(paths.begin(), paths.end(), path) - paths.begin();
  return hypothesis.unknown_of(static_cast<std::size_t>(at)).value();
}

}  // namespace

std::vector<double> gains_of_numbers(const Task& task, const FittedCandidate& base,
                                     const std::vector<WindowState>& states,
                                     std::span<const CandidateEffect> numbers) {
  Hypothesis joint = *base.hypothesis;
  for (const CandidateEffect& each : numbers) {
    joint = extended(joint, each, {}, {}, Detail::coarse);
  }
  const std::vector<double> z = carried_over(*base.hypothesis, base.fitted.z, joint);
  Equations all = reduced(jacobians_of(task, joint, z, states), joint.unknowns().size());
  std::vector<Eigen::Index> members;
  const auto& unknowns = base.hypothesis->unknowns();
  for (std::size_t u = 0; u < unknowns.size(); ++u) {
    const std::size_t same = same_in(joint, unknowns[u]);
    members.push_back(static_cast<Eigen::Index>(same));
    add_prior(all, base, u, joint, same, z[same], 1.0);
  }
  const double without = gain_of(all, members);
  std::vector<double> out;
  for (const CandidateEffect& each : numbers) {
    const std::size_t freed = unknown_at(joint, each.parameter);
    const auto calibrated = base.hypothesis->unknown_of(joint.unknowns()[freed].parameter);
    Equations equations = all;
    std::vector<Eigen::Index> with = members;
    if (calibrated) {
      add_prior(equations, base, *calibrated, joint, freed, z[freed], -1.0);
    } else {
      with.push_back(static_cast<Eigen::Index>(freed));
    }
    const double gain = gain_of(equations, with) - without;
    out.push_back(std::isfinite(gain) ? gain : 0.0);
  }
  return out;
}

}  // namespace stickslip::diagnosis
