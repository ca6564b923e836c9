// SPDX-License-Identifier: Apache-2.0
#include "physics/rig.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "physics/model.h"

namespace stickslip::physics {
namespace {

// Eqs. (5) and (6) of the paper, as unit parameters.
Model paper_model(double wedge, double gamma) {
  Model model;
  model.oscillator.mass_kg = {1.0};
  model.oscillator.stiffness_n_m = Parameter{1.0};
  model.oscillator.damping_n_s_m = Parameter{0.0};
  model.normal_load = NormalLoad{NormalLoadLaw::wedge, {1.0}, {wedge}};
  model.friction.law = gamma > 0.0 ? FrictionLaw::state_variable : FrictionLaw::coulomb;
  model.friction.mu = {1.0};
  model.friction.transition_speed_m_s = {1.0 / 50.0};
  if (gamma > 0.0) model.friction.rate_per_s = {gamma};
  return model;
}

struct Trajectory {
  const Rig& rig;
  RigState<double> state;
  double time = 0.0;

  template <class Drive>
  void advance_to(double end, double h, Drive drive) {
    const auto n = rig.numbers<double>(rig.parameter_values());
    const auto steps = static_cast<long>(std::llround((end - time) / h));
    const double start = time;
    for (long k = 0; k < steps; ++k) {
      Input a;
      Input b;
      a.base_acceleration_m_s2 = -drive(time);
      b.base_acceleration_m_s2 = -drive(start + static_cast<double>(k + 1) * h);
      rig.step(state, a, b, time, h, n);
      time = start + static_cast<double>(k + 1) * h;
    }
  }
};

TEST(Rig, FollowsEquations5And6OfThePaper) {
  const Rig rig(paper_model(1.5, 10.0));
  Trajectory run{rig, {}, 0.0};
  run.state.s[state::x] = 0.5;
  const auto drive = [](double t) { return 1.9 * std::cos(1.25 * t); };
  const double h = 2.0e-4;
  run.advance_to(1.0, h, drive);
  EXPECT_NEAR(run.state.s[state::x], 0.52880, 1.0e-4);
  EXPECT_NEAR(run.state.s[state::v], -0.00069, 1.0e-4);
  EXPECT_NEAR(run.state.theta, 0.05083, 1.0e-4);
  run.advance_to(5.0, h, drive);
  EXPECT_NEAR(run.state.s[state::x], -0.07488, 1.0e-4);
  EXPECT_NEAR(run.state.s[state::v], 1.25787, 1.0e-4);
  EXPECT_NEAR(run.state.theta, 0.99895, 1.0e-4);
  run.advance_to(10.0, h, drive);
  EXPECT_NEAR(run.state.s[state::x], 0.63404, 1.0e-4);
  EXPECT_NEAR(run.state.s[state::v], 0.01585, 1.0e-4);
  EXPECT_NEAR(run.state.theta, 0.64759, 1.0e-4);
  run.advance_to(20.0, h, drive);
  EXPECT_NEAR(run.state.s[state::x], 0.20638, 1.0e-4);
  EXPECT_NEAR(run.state.s[state::v], 0.23548, 1.0e-4);
  EXPECT_NEAR(run.state.theta, 0.99982, 1.0e-4);
}

TEST(Rig, FollowsEquations3And4OfThePaper) {
  Model model = paper_model(0.0, 10.0);
  const Rig rig(model);
  Trajectory run{rig, {}, 0.0};
  const auto drive = [](double t) { return 2.0 * std::cos(1.5 * t) * std::cos(1.5 * t / 40.0); };
  run.advance_to(10.0, 2.0e-4, drive);
  EXPECT_NEAR(run.state.s[state::x], 1.35637, 1.0e-4);
  EXPECT_NEAR(run.state.s[state::v], 0.09916, 1.0e-4);
  EXPECT_NEAR(run.state.theta, 1.0, 1.0e-4);
}

Model coulomb_decay_model() {
  Model model;
  model.oscillator.mass_kg = {0.06};
  model.oscillator.natural_frequency_hz = Parameter{2.4};
  model.oscillator.damping_ratio = Parameter{0.0};
  model.normal_load = NormalLoad{NormalLoadLaw::constant, {0.15}, {}};
  model.friction.law = FrictionLaw::coulomb;
  model.friction.mu = {0.2};
  model.friction.transition_speed_m_s = {0.0};  // set-valued
  return model;
}

TEST(Rig, CoulombFreeDecayLosesFourMuNOverKPerCycleAndSticksExactly) {
  const Rig rig(coulomb_decay_model());
  const double k = 0.06 * std::pow(2.0 * std::numbers::pi * 2.4, 2);
  const double loss = 4.0 * 0.2 * 0.15 / k;
  const double period = 1.0 / 2.4;
  Trajectory run{rig, {}, 0.0};
  const double start = 3.4 * loss;
  run.state.s[state::x] = start;
  const auto quiet = [](double) { return 0.0; };
  for (int cycle = 1; cycle <= 3; ++cycle) {
    run.advance_to(cycle * period, period / 4000.0, quiet);
    EXPECT_NEAR(run.state.s[state::x], start - cycle * loss, 0.002 * loss) << "cycle " << cycle;
  }
  run.advance_to(5.0 * period, period / 4000.0, quiet);
  EXPECT_EQ(run.state.slip, 0.0);
  EXPECT_EQ(run.state.s[state::v], 0.0);
  // At rest friction balances the spring, within the friction cone.
  EXPECT_NEAR(run.state.friction, -k * run.state.s[state::x], 1.0e-9);
  EXPECT_LE(std::abs(run.state.friction), 0.2 * 0.15);
}

TEST(Rig, LargeGammaApproachesCoulombAtFirstOrder) {
  const auto end_of = [](const Model& model) {
    const Rig rig(model);
    Trajectory run{rig, {}, 0.0};
    run.state.s[state::x] = 0.5;
    run.advance_to(6.0, 1.0e-4, [](double t) { return 1.9 * std::cos(1.25 * t); });
    return run.state.s[state::x];
  };
  const double limit = end_of(paper_model(1.5, 0.0));
  const double far = std::abs(end_of(paper_model(1.5, 400.0)) - limit);
  const double near = std::abs(end_of(paper_model(1.5, 800.0)) - limit);
  EXPECT_GT(far, 1.0e-5);
  EXPECT_NEAR(far / near, 2.0, 0.35);
}

// Largest error of theta in steps of `h` under an imposed motion, where it follows the velocity's
// direction, which reverses between the ends of a step.
double largest_error_of_theta(double h) {
  constexpr double gamma = 110.0;
  constexpr double omega = 17.0;
  Model model;
  model.oscillator.excitation = Excitation::imposed;
  model.oscillator.mass_kg = {0.06};
  model.normal_load = NormalLoad{NormalLoadLaw::constant, {0.2}, {}};
  model.friction.law = FrictionLaw::state_variable;
  model.friction.mu = {0.6};
  model.friction.transition_speed_m_s = {1.0e-6};
  model.friction.rate_per_s = {gamma};
  const Rig rig(model);
  const auto n = rig.numbers<double>(rig.parameter_values());
  const auto input_at = [](double t) {
    Input input;
    input.displacement_m = -0.03 / omega * std::cos(omega * t);
    input.velocity_m_s = 0.03 * std::sin(omega * t);
    return input;
  };
  RigState<double> state;
  double exact = 0.0;
  double largest = 0.0;
  for (int k = 0; k * h < 1.0; ++k) {
    const double t = k * h;
    rig.step(state, input_at(t), input_at(t + h), t, h, n);
    // Towards the direction of the step's beginning until it reverses, then towards the other one.
    const double half_turns = std::floor(omega * t / std::numbers::pi);
    const double first = std::fmod(half_turns, 2.0) == 0.0 ? 1.0 : -1.0;
    const double reversal = (half_turns + 1.0) * std::numbers::pi / omega;
    const double before = std::min(h, reversal - t);
    exact = first + (exact - first) * std::exp(-gamma * before);
    exact = -first + (exact + first) * std::exp(-gamma * (h - before));
    largest = std::max(largest, std::abs(state.theta - exact));
  }
  return largest;
}

TEST(Rig, LongStepsResolveTheReversalsOfFriction) {
  EXPECT_LT(largest_error_of_theta(1.0e-3), 0.005);
  EXPECT_LT(largest_error_of_theta(2.5e-4), 0.001);
}

TEST(Rig, TheLongestStepKeepsTheFrequencyOfALoadCell) {
  Model model;
  model.oscillator.mass_kg = {0.06};
  model.oscillator.natural_frequency_hz = Parameter{2.4};
  model.oscillator.damping_ratio = Parameter{0.015};
  model.friction.law = FrictionLaw::coulomb;
  model.friction.mu = {1.0e-12};
  model.load_cell = LoadCell{{0.0126}, {19.3}, {0.016}, LoadCellDynamics::resonant};
  const Rig rig(model);
  const auto n = rig.numbers<double>(rig.parameter_values());
  const double h = rig.longest_step_s();
  const double decay = 0.016 * 2.0 * std::numbers::pi * 19.3;
  const double omega = 2.0 * std::numbers::pi * 19.3 * std::sqrt(1.0 - 0.016 * 0.016);
  RigState<double> state;
  state.s[state::y] = 1.0e-3;
  state.s[state::u] = -decay * 1.0e-3;
  double largest = 0.0;
  for (int k = 1; k * h < 1.0; ++k) {
    rig.step(state, {}, {}, (k - 1) * h, h, n);
    const double exact = 1.0e-3 * std::exp(-decay * k * h) * std::cos(omega * k * h);
    largest = std::max(largest, std::abs(state.s[state::y] - exact));
  }
  EXPECT_LT(largest, 1.0e-6);
}

TEST(Rig, ASwingFromWellToWellIsFollowedToThirdOrder) {
  Model model;
  model.oscillator.mass_kg = {0.06};
  model.oscillator.damping_n_s_m = Parameter{0.0};
  model.oscillator.stiffness_n_m = Parameter{0.0};
  model.oscillator.two_well = TwoWell{{20.0}, {2.0e5}};
  const Rig rig(model);
  const auto after = [&](double h) {
    Trajectory run{rig, {}, 0.0};
    run.state.s[state::x] = 0.03;
    run.advance_to(0.4, h, [](double) { return 0.0; });
    return run.state.s[state::x];
  };
  const double exact = after(1.0e-5);
  EXPECT_NEAR(std::abs(after(1.0e-3) - exact) / std::abs(after(5.0e-4) - exact), 8.0, 1.5);
  EXPECT_LT(std::abs(after(5.0e-4) - exact), 3.0e-5);
}

TEST(Rig, StepErrorFallsWithTheSquareOfTheStepInSmoothMotion) {
  Model model = coulomb_decay_model();
  model.friction = {};
  model.oscillator.damping_ratio = Parameter{0.05};
  const Rig rig(model);
  const auto error = [&](int steps) {
    Trajectory run{rig, {}, 0.0};
    run.state.s[state::x] = 0.01;
    run.advance_to(0.5, 0.5 / steps, [](double) { return 0.0; });
    const double w = 2.0 * std::numbers::pi * 2.4;
    const double wd = w * std::sqrt(1.0 - 0.05 * 0.05);
    const double exact = 0.01 * std::exp(-0.05 * w * 0.5) *
                         (std::cos(wd * 0.5) + 0.05 * w / wd * std::sin(wd * 0.5));
    return std::abs(run.state.s[state::x] - exact);
  };
  EXPECT_NEAR(error(500) / error(1000), 4.0, 0.2);
}

// Derivatives by dual numbers against central differences, through stick and slip, load cell, wedge
// and every kinetics.
Model model_with_term(const std::string& id) {
  Model model;
  model.oscillator.mass_kg = {0.06};
  model.oscillator.natural_frequency_hz = Parameter{2.4};
  model.oscillator.damping_ratio = Parameter{0.015};
  model.normal_load = NormalLoad{NormalLoadLaw::wedge, {0.15}, {20.0}};
  model.friction.law = FrictionLaw::coulomb;
  model.friction.mu = {0.8};
  model.friction.transition_speed_m_s = {0.01};
  model.load_cell = LoadCell{{0.0126}, {19.3}, {0.016}, LoadCellDynamics::resonant};
  if (id == "friction_memory") model.terms.push_back({id, {}, {{"gamma_per_s", {60.0}}}});
  if (id == "contact_compliance") {
    model.terms.push_back({id, {}, {{"contact_stiffness_n_m", {150.0}}}});
  }
  if (id == "stribeck") {
    model.terms.push_back({id, {}, {{"static_ratio", {1.4}}, {"stribeck_speed_m_s", {0.05}}}});
  }
  if (id == "hysteresis") {
    model.terms.push_back({id, {}, {{"stiffness_n_m", {8.0}}, {"slip_force_n", {0.05}}}});
  }
  return model;
}

template <class T>
RigState<T> state_after_a_shake(const Rig& rig, const std::vector<T>& parameters) {
  const auto n = rig.numbers<T>(std::span<const T>(parameters));
  RigState<T> state;
  state.s[state::x] = T(0.004);
  const auto base = [](double time) {
    return -2.5 * std::cos(2.0 * std::numbers::pi * 2.9 * time);
  };
  double t = 0.0;
  const double h = 2.5e-4;
  for (int k = 0; k < 1600; ++k) {
    Input a;
    Input b;
    a.base_acceleration_m_s2 = base(t);
    b.base_acceleration_m_s2 = base(t + h);
    rig.step(state, a, b, t, h, n);
    t += h;
  }
  return state;
}

class Derivatives : public testing::TestWithParam<const char*> {};

TEST_P(Derivatives, AgreeWithDifferences) {
  const Rig rig(model_with_term(GetParam()));
  const auto& values = rig.parameter_values();
  std::vector<Dual> duals;
  for (std::size_t i = 0; i < values.size(); ++i) {
    Dual value(values[i]);
    value.d[static_cast<Eigen::Index>(i)] = 1.0;
    duals.push_back(value);
  }
  ASSERT_LE(values.size(), static_cast<std::size_t>(Dual::directions));
  const auto exact = state_after_a_shake(rig, duals);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double step = 1.0e-5 * values[i];
    auto up = values;
    auto down = values;
    up[i] += step;
    down[i] -= step;
    const auto high = state_after_a_shake(rig, up);
    const auto low = state_after_a_shake(rig, down);
    for (const int index : {state::x, state::v, state::y}) {
      const auto s = static_cast<std::size_t>(index);
      const double difference = (high.s[s] - low.s[s]) / (2.0 * step);
      const double scale = std::abs(exact.s[s].a / values[i]);
      EXPECT_NEAR(exact.s[s].d[static_cast<Eigen::Index>(i)], difference,
                  2.0e-4 * scale + 2.0e-3 * std::abs(difference))
          << rig.parameter_paths()[i] << ", state " << index;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Laws, Derivatives,
                         testing::Values("", "friction_memory", "contact_compliance", "stribeck",
                                         "hysteresis"));

TEST(FrictionMemory, WithASpreadIsTheSumOfTwoProcessesWithOneMeanLag) {
  Model model;
  model.oscillator.excitation = Excitation::imposed;
  model.friction.law = FrictionLaw::coulomb;
  model.friction.mu = {2.0};
  model.friction.transition_speed_m_s = {1.0e-6};
  model.terms.push_back({"friction_memory", {}, {{"gamma_per_s", {80.0}}, {"spread", {0.5}}}});
  const Rig rig(model);
  const auto numbers = rig.numbers<double>(rig.parameter_values());
  RigState<double> now;
  const double h = 1.0e-5;
  double lag = 0.0;
  for (int k = 0; k < 20000; ++k) {
    Input begin;
    begin.velocity_m_s = 0.1;
    begin.displacement_m = 0.1 * h * k;
    Input end = begin;
    end.displacement_m += 0.1 * h;
    rig.step(now, begin, end, h * k, h, numbers);
    const double t = h * (k + 1);
    const double expected =
        1.0 - 0.75 * std::exp(-80.0 * 1.5 * t) - 0.25 * std::exp(-80.0 * 0.5 * t);
    ASSERT_NEAR(now.friction, 2.0 * expected, 2.0e-3) << t;
    lag += (1.0 - now.theta) * h;
  }
  EXPECT_NEAR(lag * 80.0, 1.0, 1.0e-2);
}

}  // namespace
}  // namespace stickslip::physics
