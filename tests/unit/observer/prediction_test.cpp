// SPDX-License-Identifier: Apache-2.0
// ContactPrediction compared with DualPrediction, and both with their derivatives.
#include "observer/prediction.h"

#include <gtest/gtest.h>

#include <random>

#include "observer/contact_prediction.h"
#include "observer/dual_prediction.h"
#include "observer/sensor_correction.h"
#include "tests/unit/observer/bench.h"

namespace stickslip::observer {
namespace {

using physics::Model;
using test::Law;
using test::paper_rig;

constexpr double period_s = 1.0e-3;

struct Case {
  std::string name;
  Model model;
};

Model with_sigmas(Model model) {
  model.friction.mu.sigma = 0.1;
  if (model.friction.law == physics::FrictionLaw::state_variable) {
    model.friction.rate_per_s.sigma = 20.0;
  }
  if (model.normal_load) model.normal_load->load_n.sigma = 0.01;
  return model;
}

std::vector<Case> cases() {
  std::vector<Case> out = {
      {"Coulomb", paper_rig(Law::coulomb)},
      {"CoulombQuasiStatic", paper_rig(Law::coulomb, false, false)},
      {"StateVariable", paper_rig(Law::state_variable)},
      {"Uncertain", with_sigmas(paper_rig(Law::state_variable))},
      {"Wedge", paper_rig(Law::coulomb, true)},
      {"UncertainWedge", with_sigmas(paper_rig(Law::state_variable, true, false))},
  };
  Model bridged = with_sigmas(paper_rig(Law::state_variable, true));
  bridged.normal_load_bridge = physics::NormalLoadBridge{.mismatch = 0.03, .share = 0.55};
  out.push_back({"Bridged", bridged});
  Model measured = paper_rig(Law::state_variable);
  measured.normal_load = physics::NormalLoad{physics::NormalLoadLaw::measured, {}, {}};
  out.push_back({"MeasuredLoad", measured});
  Model forced = paper_rig(Law::coulomb);
  forced.oscillator.excitation = physics::Excitation::force;
  forced.load_cell.reset();
  forced.normal_load.reset();
  forced.friction.mu = {0.12};
  out.push_back({"Forced", forced});
  Model smooth = paper_rig(Law::coulomb);
  smooth.friction = {};
  smooth.friction.law = physics::FrictionLaw::none;
  smooth.normal_load.reset();
  out.push_back({"WithoutFriction", smooth});
  Model bare = paper_rig(Law::state_variable);
  for (physics::Sensor& sensor : bare.sensors) sensor.filters.clear();
  out.push_back({"WithoutFilters", bare});
  for (auto [name, model] : {std::pair{"SensorErrors", with_sigmas(paper_rig(Law::state_variable))},
                             std::pair{"SensorErrorsWithoutFilters", bare}}) {
    model.terms = {{"channel_delay", Channel::friction_force, {{"delay_s", {0.0095}}}},
                   {"channel_delay", Channel::displacement, {{"delay_s", {0.0007}}}},
                   {"mains_hum",
                    Channel::friction_force,
                    {{"frequency_hz", {50.0}}, {"amplitude", {0.01}}, {"phase_rad", {0.4}}}},
                   {"sensor_drift", Channel::velocity, {{"rate_per_s", {0.02}}}}};
    out.push_back({name, model});
  }
  return out;
}

class Predictions : public testing::TestWithParam<Case> {
 protected:
  Predictions()
      : separated_(separate_sensor_errors(GetParam().model)),
        model_(separated_.model),
        rig_(model_),
        layout_(make_layout(model_, rig_, reason_, separated_.laws)) {}

  // A random state of a moving, slipping, driven rig.
  Vector random_state(std::mt19937& random) const {
    std::normal_distribution<double> gauss;
    Vector z = Vector::Zero(layout_.count);
    const auto set = [&](int at, double scale) {
      if (at >= 0) z[at] = scale * gauss(random);
    };
    namespace state = physics::state;
    set(layout_.rig[state::x], 0.01);
    set(layout_.rig[state::v], 0.1);
    set(layout_.rig[state::y], 5.0e-4);
    set(layout_.rig[state::u], 0.02);
    set(layout_.theta, 0.4);
    set(layout_.friction, 0.05);
    const auto c = rig_.numbers<double>(std::span<const double>(rig_.parameter_values())).c;
    if (layout_.mu >= 0) z[layout_.mu] = c.mu * (1.0 + 0.1 * gauss(random));
    if (layout_.log_rate >= 0) z[layout_.log_rate] = std::log(c.rate) + 0.2 * gauss(random);
    if (layout_.load >= 0) z[layout_.load] = 0.15 * (1.0 + 0.05 * gauss(random));
    set(layout_.load_rate, 0.3);
    const bool base = rig_.structure().excitation == physics::Excitation::base;
    const double size = base ? 0.01 : 0.2;
    set(layout_.drive, size);
    set(layout_.drive + 1, 18.0 * size);
    set(layout_.drive + 2, 350.0 * size);
    z[layout_.drive + 3] = 350.0;
    for (Channel channel : all_channels) {
      const Chain& chain = layout_.of(channel);
      int next = chain.first;
      const double scale = channel == Channel::velocity ? 0.1 : 0.01;
      if (chain.sections.empty() && chain.used) set(next, scale);
      for (const Section& section : chain.sections) {
        set(next++, scale);
        if (section.second_order) set(next++, 20.0 * scale);
      }
      for (int k = 0; k < chain.delays; ++k) {
        set(chain.first_delay + 2 * k, scale);
        set(chain.first_delay + 2 * k + 1, 20.0 * scale);
      }
      if (chain.hum >= 0) set(chain.hum, scale);
      set(chain.offset, scale);
    }
    return z;
  }

  std::string reason_;
  SeparatedModel separated_;
  Model model_;
  physics::Rig rig_;
  Layout layout_;
};

TEST_P(Predictions, ContactAgreesWithTheRigsIntegrator) {
  ASSERT_TRUE(ContactPrediction::supports(rig_, model_));
  ContactPrediction contact(rig_, model_, layout_, period_s);
  DualPrediction dual(rig_, model_, layout_, period_s, 64);
  std::mt19937 random(1);
  for (int round = 0; round < 5; ++round) {
    Vector a = random_state(random);
    Vector b = a;
    Vector error = Vector::Zero(layout_.count);
    Vector size = Vector::Zero(layout_.count);
    for (int k = 0; k < 300; ++k) {
      // Standard deviation of the slip velocity: 2 mm/s.
      contact.advance(a, k * period_s, 4.0e-6);
      dual.advance(b, k * period_s, 4.0e-6);
      if (k < 20) continue;  // transient of the random initial state
      error += (a - b).cwiseAbs2();
      size += b.cwiseAbs2();
    }
    for (int i = 0; i < layout_.count; ++i) {
      EXPECT_LT(std::sqrt(error[i]), 0.04 * std::sqrt(size[i]) + 1.0e-12) << "state " << i;
    }
  }
}

void expect_derivatives(Prediction& prediction, const Vector& from, double relative) {
  Vector moved = from;
  prediction.advance(moved, 0.0, 1.0e-5);
  const Matrix jacobian = prediction.transition().dense();
  for (int column = 0; column < from.size(); ++column) {
    const double step = 1.0e-5 * std::max(1.0e-3, std::abs(from[column]));
    Vector up = from;
    Vector down = from;
    up[column] += step;
    down[column] -= step;
    prediction.advance(up, 0.0, 1.0e-5);
    prediction.advance(down, 0.0, 1.0e-5);
    for (int row = 0; row < from.size(); ++row) {
      const double measured = (up[row] - down[row]) / (2.0 * step);
      EXPECT_NEAR(jacobian(row, column), measured, relative * (1.0e-2 + std::abs(measured)))
          << "d " << row << " / d " << column;
    }
  }
}

TEST_P(Predictions, ContactHasExactDerivatives) {
  ContactPrediction prediction(rig_, model_, layout_, period_s);
  std::mt19937 random(2);
  for (int round = 0; round < 10; ++round) {
    expect_derivatives(prediction, random_state(random), 1.0e-4);
  }
}

// The model with every parameter uncertain by one per cent that is no state of the filter.
Model uncertain(Model model, const Layout& layout) {
  for (const physics::NamedParameter& each : physics::parameters_of(model)) {
    each.parameter->sigma = 0.01 * std::abs(each.parameter->value);
  }
  if (layout.mu >= 0) model.friction.mu.sigma = 0.0;
  if (layout.log_rate < 0) model.friction.rate_per_s.sigma = 0.0;
  return model;
}

std::vector<double> changes_of(const ParameterResponse& response, int parameter) {
  std::vector<double> out;
  for (const ParameterLanes& each : response.changes(parameter / parameter_lanes)) {
    out.push_back(each[parameter % parameter_lanes]);
  }
  return out;
}

TEST_P(Predictions, ContactRespondsToParametersAsPredictionsWithOtherValues) {
  const Model changed = uncertain(model_, layout_);
  ContactPrediction prediction(rig_, model_, layout_, period_s);
  const auto response =
      prediction.response_to(uncertain_parameters(changed, rig_, layout_), model_);
  std::mt19937 random(4);
  const Vector before = random_state(random);
  // The responses of chains are approximate.
  const auto is_own = [&](int row) {
    return row < layout_.core || row == layout_.friction || row == layout_.theta;
  };
  Vector after = before;
  prediction.advance(after, 0.0, 0.0);
  response->update(before, after, 0.0, prediction.widened_transition_speed(0.0));
  for (int i = 0; i < response->count(); ++i) {
    const std::vector<double> changes = changes_of(*response, i);
    constexpr double share = 1.0e-3;
    const auto moved = [&](double by) {
      Model other = model_;
      for (const physics::NamedParameter& each : physics::parameters_of(other)) {
        if (each.path == response->paths()[static_cast<std::size_t>(i)]) {
          each.parameter->value *= 1.0 + 0.01 * share * by;
        }
      }
      const physics::Rig rig(other);
      Vector out = before;
      ContactPrediction(rig, other, layout_, period_s).advance(out, 0.0, 0.0);
      return out;
    };
    const Vector expected = (moved(1.0) - moved(-1.0)) / (2.0 * share);
    for (std::size_t k = 0; k < changes.size(); ++k) {
      const int row = response->rows()[k];
      if (!is_own(row)) continue;
      EXPECT_NEAR(changes[k], expected[row], 1.0e-2 * std::abs(expected[row]) + 1.0e-8)
          << "state " << row << " by " << response->paths()[static_cast<std::size_t>(i)];
    }
  }
}

TEST_P(Predictions, ContactAtRestReadsTheTrueValues) {
  ContactPrediction prediction(rig_, model_, layout_, period_s);
  std::mt19937 random(3);
  Vector z = random_state(random);
  for (int i = 0; i < 3; ++i) z[layout_.drive + 1 + i] = 0.0;
  if (layout_.load_rate >= 0) z[layout_.load_rate] = 0.0;
  // Smooth friction creeps, and without friction the oscillation decays slowly.
  const double tolerance = rig_.structure().friction ? 1.0e-6 : 1.0e-4;
  for (int k = 0; k < 20000; ++k) prediction.advance(z, 0.0, 1.0e-6);
  const auto expect = [&](Channel channel, double value) {
    const Chain& chain = layout_.of(channel);
    if (!chain.used) return;
    EXPECT_NEAR(z[chain.reading], value, 2.0e-6 * std::abs(value) + tolerance);
    for (int k = 0; k < chain.delays; ++k) {
      EXPECT_NEAR(z[chain.first_delay + 2 * k], value, 2.0e-6 * std::abs(value) + tolerance);
    }
  };
  namespace state = physics::state;
  expect(drive_channel(rig_.structure()), z[layout_.drive]);
  expect(Channel::displacement, z[layout_.rig[state::x]]);
  if (layout_.rig[state::y] >= 0) {
    const double k = prediction.numbers().c.cell_stiffness;
    expect(Channel::friction_force, k * z[layout_.rig[state::y]]);
  } else if (layout_.friction >= 0) {
    expect(Channel::friction_force, z[layout_.friction]);
  }
  if (rig_.structure().load_law != physics::NormalLoadLaw::wedge && layout_.load >= 0) {
    expect(Channel::normal_load, z[layout_.load]);
  }
}

INSTANTIATE_TEST_SUITE_P(Rigs, Predictions, testing::ValuesIn(cases()),
                         [](const auto& info) { return info.param.name; });

TEST(Prediction, ContactSupportsLinearRigsOnly) {
  const auto supports = [](const Model& model) {
    return ContactPrediction::supports(physics::Rig(model), model);
  };
  EXPECT_TRUE(supports(paper_rig(Law::coulomb)));
  Model hardening = paper_rig(Law::coulomb);
  hardening.terms.push_back({"cubic_stiffness", {}, {{"k3_n_m3", {1.0e4}}}});
  EXPECT_FALSE(supports(hardening));
  Model two_wells = paper_rig(Law::coulomb);
  two_wells.oscillator.two_well = physics::TwoWell{{10.0}, {1.0e5}};
  EXPECT_FALSE(supports(two_wells));
}

}  // namespace
}  // namespace stickslip::observer
