#include "observer/doubted_constants.h"

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
constexpr std::array judged = {Quantity::displacement, Quantity::velocity, Quantity::mu};

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
  model.sensors[index_of(Channel::drive_force)] = {1.0e-3, {}};
  return model;
}

/// What the base does to the mass of the paper's rig, as a force beside it.
physics::Input drive(double t) {
  physics::Input input = test::ModulatedBase{}(t);
  input.drive_force_n = -0.06 * input.base_acceleration_m_s2;
  return input;
}

/// An estimate, its filter's own variance, and what doubted constants are told to lead it astray
/// by, at each frame.
struct Followed {
  std::vector<std::array<double, judged.size()>> estimate, own, told;
};

Followed follow(const Model& real, const Model& believed, double seconds) {
  physics::RigSimulator rig(real, {.step_s = 1.25e-4, .noise = false});
  rig.set_input(drive(0.0));
  KalmanFilter filter(believed, period_s);
  EXPECT_EQ(filter.unsupported(), "");
  std::string reason;
  const physics::Rig equations(believed);
  const Layout layout = layout_of(believed, equations, reason);
  const std::array<int, judged.size()> state = {layout.rig[physics::state::x],
                                                layout.rig[physics::state::v], layout.mu};
  Followed out;
  for (int k = 1; k * period_s <= seconds; ++k) {
    for (int piece = 1; piece <= 2; ++piece) {
      rig.advance(0.5 * period_s, drive((k - 1 + 0.5 * piece) * period_s));
    }
    filter.update(rig.read());
    const FrictionEstimate& e = filter.estimate();
    out.estimate.push_back({e.displacement_m, e.velocity_m_s, e.mu});
    std::array<double, judged.size()> own{}, told{};
    for (std::size_t i = 0; i < judged.size(); ++i) {
      own[i] = filter.covariance()(state[i], state[i]);
      told[i] = std::sqrt(std::max(0.0, std::pow(e.standard_deviation(judged[i]), 2) - own[i]));
    }
    out.own.push_back(own);
    out.told.push_back(told);
  }
  return out;
}

struct Case {
  const char* name;
  Model (*rig)();
  std::function<Parameter&(Model&)> constant;
  double share;  ///< sigma over value
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class DoubtedConstant : public testing::TestWithParam<Case> {};

// Two filters whose constant differs by one sigma follow the same rig.
TEST_P(DoubtedConstant, LeadsTheEstimateAstrayByWhatIsTold) {
  const Case& c = GetParam();
  const Model real = c.rig();
  Model believed = real;
  Parameter& doubted = c.constant(believed);
  doubted.sigma = c.share * std::abs(doubted.value);
  Model off = believed;
  c.constant(off).value += doubted.sigma;
  const Followed at = follow(real, believed, 12.0);
  const Followed beside = follow(real, off, 12.0);
  for (std::size_t i = 0; i < judged.size(); ++i) {
    double astray = 0.0, told = 0.0, own = 0.0;
    constexpr std::size_t from = 6000;
    for (std::size_t k = from; k < at.estimate.size(); ++k) {
      astray += std::pow(beside.estimate[k][i] - at.estimate[k][i], 2);
      told += std::pow(at.told[k][i], 2);
      own += at.own[k][i];
    }
    const auto root_mean = [&](double sum) {
      return std::sqrt(sum / static_cast<double>(at.estimate.size() - from));
    };
    // What is far below the filter's own doubt need not be exact.
    EXPECT_NEAR(root_mean(told), root_mean(astray), 0.1 * root_mean(astray) + 0.1 * root_mean(own))
        << name_of(judged[i]) << ", own doubt " << root_mean(own);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Oscillators, DoubtedConstant,
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

// A doubt beyond what a mass can be is large, and no more.
TEST(DoubtedConstants, MayBeDoubtedByMoreThanTheyAre) {
  Model model = linear_rig();
  model.oscillator.mass_kg.sigma = 3.0 * model.oscillator.mass_kg.value;
  const Followed one = follow(linear_rig(), model, 2.0);
  for (const double value : one.told.back()) {
    EXPECT_TRUE(std::isfinite(value));
    EXPECT_GT(value, 0.0);
  }
}

TEST(DoubtedConstants, AddNothingWhereTheModelDoubtsNone) {
  const Followed one = follow(linear_rig(), linear_rig(), 0.5);
  for (const auto& told : one.told) {
    for (const double value : told) EXPECT_LT(value, 1.0e-6);  // a root of rounding
  }
}

}  // namespace
}  // namespace stickslip::observer
