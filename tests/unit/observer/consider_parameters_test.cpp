// SPDX-License-Identifier: Apache-2.0
#include "observer/consider_parameters.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "observer/kalman_filter.h"
#include "tests/unit/observer/bench.h"

namespace stickslip::observer {
namespace {

using physics::Model;
using physics::Parameter;

constexpr double period_s = 1.0e-3;
constexpr std::array compared = {Quantity::displacement, Quantity::velocity, Quantity::mu};

Model linear_rig() {
  Model model = test::paper_rig(test::Law::state_variable);
  model.friction.mu.sigma = 0.1;
  return model;
}

Model two_well_rig() {
  Model model = linear_rig();
  model.oscillator.natural_frequency_hz.reset();
  model.oscillator.stiffness_n_m = Parameter{0.0};
  model.oscillator.damping_ratio.reset();
  model.oscillator.damping_n_s_m = Parameter{0.03};
  model.oscillator.two_well = physics::TwoWell{{6.0}, {6.0e4}};
  return model;
}

Model forced_rig() {
  Model model = linear_rig();
  model.oscillator.excitation = physics::Excitation::force;
  model.load_cell.reset();
  model.sensors[index_of(Channel::drive_force)].noise_std = 1.0e-3;
  return model;
}

/// Base motion of the paper's rig, and the equivalent force on its mass.
physics::Input drive(double t) {
  physics::Input input = test::ModulatedBase{}(t);
  input.drive_force_n = -0.06 * input.base_acceleration_m_s2;
  return input;
}

/// At each frame: the estimate, the filter's own variance, and the standard deviation that the
/// consider parameters add.
struct Trace {
  std::vector<std::array<double, compared.size()>> estimate, own, added;
};

Trace observe(const Model& real, const Model& assumed, double seconds) {
  physics::RigSimulator rig(real, {.step_s = 1.25e-4, .noise = false});
  rig.set_input(drive(0.0));
  KalmanFilter filter(assumed, period_s);
  EXPECT_EQ(filter.unsupported(), "");
  std::string reason;
  const physics::Rig equations(assumed);
  const Layout layout = make_layout(assumed, equations, reason);
  const std::array<int, compared.size()> state = {layout.rig[physics::state::x],
                                                  layout.rig[physics::state::v], layout.mu};
  Trace out;
  for (int k = 1; k * period_s <= seconds; ++k) {
    for (int half = 1; half <= 2; ++half) {
      rig.advance(0.5 * period_s, drive((k - 1 + 0.5 * half) * period_s));
    }
    filter.update(rig.read());
    const FrictionEstimate& e = filter.estimate();
    out.estimate.push_back({e.displacement_m, e.velocity_m_s, e.mu});
    std::array<double, compared.size()> own{}, added{};
    for (std::size_t i = 0; i < compared.size(); ++i) {
      own[i] = filter.covariance()(state[i], state[i]);
      if (compared[i] == Quantity::mu) own[i] += std::pow(backbone_std * e.mu, 2);
      added[i] = std::sqrt(std::max(0.0, std::pow(e.standard_deviation(compared[i]), 2) - own[i]));
    }
    out.own.push_back(own);
    out.added.push_back(added);
  }
  return out;
}

struct Case {
  const char* name;
  Model (*rig)();
  std::function<Parameter&(Model&)> parameter;
  double share;  ///< sigma over value
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class ConsiderParameter : public testing::TestWithParam<Case> {};

// Two filters whose parameter differs by one standard deviation observe the same rig.
TEST_P(ConsiderParameter, AddsTheEffectOfOneStandardDeviation) {
  const Case& c = GetParam();
  const Model real = c.rig();
  Model assumed = real;
  Parameter& parameter = c.parameter(assumed);
  parameter.sigma = c.share * std::abs(parameter.value);
  Model shifted = assumed;
  c.parameter(shifted).value += parameter.sigma;
  const Trace nominal = observe(real, assumed, 12.0);
  const Trace perturbed = observe(real, shifted, 12.0);
  for (std::size_t i = 0; i < compared.size(); ++i) {
    double difference = 0.0, added = 0.0, own = 0.0;
    constexpr std::size_t from = 6000;
    for (std::size_t k = from; k < nominal.estimate.size(); ++k) {
      difference += std::pow(perturbed.estimate[k][i] - nominal.estimate[k][i], 2);
      added += std::pow(nominal.added[k][i], 2);
      own += nominal.own[k][i];
    }
    const auto root_mean = [&](double sum) {
      return std::sqrt(sum / static_cast<double>(nominal.estimate.size() - from));
    };
    // Effects far below the filter's own standard deviation need not be exact.
    EXPECT_NEAR(root_mean(added), root_mean(difference),
                0.1 * root_mean(difference) + 0.1 * root_mean(own))
        << name_of(compared[i]) << ", own standard deviation " << root_mean(own);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Oscillators, ConsiderParameter,
    testing::Values(
        Case{"mass", linear_rig, [](Model& m) -> Parameter& { return m.oscillator.mass_kg; }, 0.02},
        Case{"frequency", linear_rig,
             [](Model& m) -> Parameter& { return *m.oscillator.natural_frequency_hz; }, 0.005},
        Case{"damping", linear_rig,
             [](Model& m) -> Parameter& { return *m.oscillator.damping_ratio; }, 0.6},
        Case{"mass_driven_by_a_force", forced_rig,
             [](Model& m) -> Parameter& { return m.oscillator.mass_kg; }, 0.005},
        Case{"damping_of_two_wells", two_well_rig,
             [](Model& m) -> Parameter& { return *m.oscillator.damping_n_s_m; }, 0.6},
        Case{"linear_of_two_wells", two_well_rig,
             [](Model& m) -> Parameter& { return m.oscillator.two_well->linear_n_m; }, 0.005},
        Case{"cubic_of_two_wells", two_well_rig,
             [](Model& m) -> Parameter& { return m.oscillator.two_well->cubic_n_m3; }, 0.005}),
    [](const auto& one) { return one.param.name; });

TEST(ConsiderParameters, SigmaMayExceedTheValue) {
  Model model = linear_rig();
  model.oscillator.mass_kg.sigma = 3.0 * model.oscillator.mass_kg.value;
  const Trace trace = observe(linear_rig(), model, 2.0);
  for (const double value : trace.added.back()) {
    EXPECT_TRUE(std::isfinite(value));
    EXPECT_GT(value, 0.0);
  }
}

TEST(ConsiderParameters, AddNothingWithoutSigmas) {
  const Trace trace = observe(linear_rig(), linear_rig(), 0.5);
  for (const auto& added : trace.added) {
    for (const double value : added) EXPECT_LT(value, 1.0e-6);  // square root of rounding errors
  }
}

}  // namespace
}  // namespace stickslip::observer
