// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/friction_picture.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace stickslip::diagnosis {

namespace {

using physics::Model;

Model model_of(const FittedCandidate& each, std::size_t unknown, double by) {
  std::vector<double> z = each.fitted.z;
  if (unknown < z.size()) z[unknown] += by;
  return each.hypothesis->model_at(z);
}

// Points spread over the longest segment of the recording.
RecordedFriction spread_friction(const Experiment& e) {
  constexpr std::size_t most = 1500;
  RecordedFriction out;
  if (!e.is_compared(index_of(Channel::friction_force)) || e.guess.empty()) return out;
  const Segment segment = e.longest_segment();
  const std::size_t count = segment.usable_end - segment.usable_begin;
  const std::size_t step = std::max<std::size_t>(1, count / most);
  for (std::size_t k = segment.usable_begin; k < segment.usable_end; k += step) {
    out.displacement_m.push_back(e.guess[k].displacement_m);
    out.velocity_m_s.push_back(e.guess[k].velocity_m_s);
    out.force_n.push_back(e.guess[k].friction_n);
  }
  return out;
}

Curve curve_of(const FrictionCycle& cycle) {
  return {"cycle", "", "friction force", "N", cycle.velocity_m_s, cycle.force_n};
}

// Unknowns with a standard deviation that the friction depends on.
std::vector<std::size_t> unknowns_of(const FittedCandidate& each, const FrictionCycle& fitted,
                                     const Experiment& experiment) {
  std::vector<std::size_t> out;
  const auto size = static_cast<std::size_t>(each.fitted.covariance.rows());
  for (std::size_t u = 0; u < std::min(size, each.fitted.z.size()); ++u) {
    const auto i = static_cast<Eigen::Index>(u);
    const double variance = each.fitted.covariance(i, i);
    if (!(variance > 0.0) || !std::isfinite(variance)) continue;
    const FrictionCycle moved = friction_cycle(model_of(each, u, std::sqrt(variance)), experiment);
    if (moved.force_n != fitted.force_n) out.push_back(u);
  }
  return out;
}

}  // namespace

FrictionPicture friction_picture(const FittedCandidate& declared, const FittedCandidate& mended,
                                 const Experiment& experiment) {
  FrictionPicture out;
  out.recorded = spread_friction(experiment);
  out.declared = friction_cycle(declared.hypothesis->model_at(declared.fitted.z), experiment);
  out.mended = friction_cycle(mended.hypothesis->model_at(mended.fitted.z), experiment);
  const std::vector<std::size_t> unknowns = unknowns_of(mended, out.mended, experiment);
  const auto n = static_cast<Eigen::Index>(unknowns.size());
  const Eigen::MatrixXd& covariance = mended.fitted.covariance;
  const auto index = [&](Eigen::Index i) {
    return static_cast<Eigen::Index>(unknowns[static_cast<std::size_t>(i)]);
  };
  Eigen::MatrixXd correlation(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      correlation(i, j) =
          covariance(index(i), index(j)) /
          std::sqrt(covariance(index(i), index(i)) * covariance(index(j), index(j)));
    }
  }
  std::vector<Curve> curves = {curve_of(out.mended)};
  add_bands(curves, correlation, [&](Eigen::Index i, double by) {
    const std::size_t u = unknowns[static_cast<std::size_t>(i)];
    const Model moved = model_of(mended, u, by * mended.fitted.standard_deviation(u));
    return std::vector<Curve>{curve_of(friction_cycle(moved, experiment))};
  });
  out.low_n = std::move(curves.front().low);
  out.high_n = std::move(curves.front().high);
  return out;
}

}  // namespace stickslip::diagnosis
