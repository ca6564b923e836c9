// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/fitted_candidate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "physics/catalogue.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

// A mode of the beam that moves with the base, by `share` standard deviations of that share; its
// damping is known to `damping_log_std` (relative).
FittedCandidate mode(double share, double damping_log_std) {
  physics::Model model = test::driven_mass();
  model.oscillator.excitation = physics::Excitation::base;
  FittedCandidate out;
  out.candidate.effect = physics::find_effect("second_mode");
  constexpr double error = 0.05;
  out.hypothesis = extended(Hypothesis(model), out.candidate,
                            std::vector{37.0, 0.0, share * error, 0.01}, {}, Detail::coarse);
  const auto& unknowns = out.hypothesis->unknowns();
  const auto size = static_cast<Eigen::Index>(unknowns.size());
  out.fitted.z.assign(unknowns.size(), 0.0);
  out.fitted.covariance = Eigen::MatrixXd::Zero(size, size);
  for (const OwnParameter& own : own_indices(out)) {
    const std::size_t u = *out.hypothesis->unknown_of(static_cast<std::size_t>(own.index));
    const auto i = static_cast<Eigen::Index>(u);
    const double sigma = unknowns[u].logarithmic ? damping_log_std : error;
    out.fitted.covariance(i, i) = std::pow(sigma / unknowns[u].scale, 2);
  }
  return out;
}

// Its states, which are free in every window, follow a hum whose amplitude wanders.
TEST(FittedCandidate, ActsByItsStatesAloneIfItsSizesMayBeNone) {
  EXPECT_TRUE(acts_by_its_states_alone(mode(0.0, 0.1), Criteria()));
  EXPECT_TRUE(acts_by_its_states_alone(mode(1.0, 0.1), Criteria()));
  EXPECT_FALSE(acts_by_its_states_alone(mode(10.0, 0.1), Criteria()));
  EXPECT_FALSE(acts_by_its_states_alone(mode(-10.0, 0.1), Criteria()));
}

TEST(FittedCandidate, IsNotDeterminedWithoutAPositiveParameter) {
  EXPECT_TRUE(is_determined(mode(10.0, 0.1), Criteria()));
  EXPECT_FALSE(is_determined(mode(10.0, 3.0), Criteria()));
}

}  // namespace
}  // namespace stickslip::diagnosis
