// SPDX-License-Identifier: Apache-2.0
// Every parameter of a model that changes the observer's estimates widens their covariance if it is
// declared uncertain: none is ignored.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "observer/kalman_filter.h"
#include "physics/catalogue.h"
#include "tests/unit/observer/bench.h"

namespace stickslip::observer {
namespace {

using physics::Model;

constexpr double period_s = 1.0e-3;

std::vector<Frame> frames_of(const Model& model) {
  physics::RigSimulator rig(model, {.step_s = 1.25e-4, .seed = 3});
  const test::ModulatedBase drive{.depth = 0.5};
  rig.set_input(drive(0.0));
  std::vector<Frame> frames;
  for (int k = 1; k <= 500; ++k) {
    rig.advance(period_s, drive(k * period_s));
    frames.push_back(rig.read());
  }
  return frames;
}

/// Sums over a run.
struct Outcome {
  double values = 0.0;
  double deviations = 0.0;  ///< of all quantities, and of the innovations
};

Outcome observe(const Model& model, const std::vector<Frame>& frames) {
  KalmanFilter filter(model, period_s);
  EXPECT_EQ(filter.unsupported(), "");
  Outcome out;
  for (const Frame& frame : frames) {
    filter.update(frame);
    const FrictionEstimate& e = filter.estimate();
    out.values += std::abs(e.friction_force_n) + std::abs(e.theta) + e.mu;
    for (std::size_t i = 0; i < e.used; ++i) out.deviations += std::sqrt(e.covariance[i][i]);
    for (const double each : e.innovation_std) out.deviations += each;
  }
  return out;
}

void expect_none_ignored(const Model& model, const std::vector<std::string>& paths) {
  const std::vector<Frame> frames = frames_of(model);
  const Outcome certain = observe(model, frames);
  Model changed = model;
  for (const physics::NamedParameter& each : physics::parameters_of(changed)) {
    if (std::find(paths.begin(), paths.end(), each.path) == paths.end()) continue;
    const physics::Parameter before = *each.parameter;
    const double sigma = 0.05 * std::abs(before.value);
    if (sigma == 0.0) continue;
    each.parameter->sigma = sigma;
    const double uncertain = observe(changed, frames).deviations;
    *each.parameter = {before.value + sigma, 0.0};
    const double effect = observe(changed, frames).values - certain.values;
    *each.parameter = before;
    if (std::abs(effect) < 1.0e-6 * certain.values) continue;  // not in this observer's equations
    EXPECT_NE(uncertain, certain.deviations) << each.path;
  }
}

void expect_none_ignored(Model model) {
  std::vector<std::string> paths;
  for (const physics::NamedParameter& each : physics::parameters_of(model)) {
    paths.push_back(each.path);
  }
  expect_none_ignored(model, paths);
}

TEST(DeclaredUncertainties, AreAllUsed) {
  for (const bool resonant : {false, true}) {
    Model model = test::paper_rig(test::Law::state_variable, true, resonant);
    expect_none_ignored(model);
    model.oscillator.natural_frequency_hz.reset();
    model.oscillator.damping_ratio.reset();
    model.oscillator.stiffness_n_m = {{13.6}};
    model.oscillator.damping_n_s_m = {{0.03}};
    expect_none_ignored(model);
    model.oscillator.stiffness_n_m = {{0.0}};
    model.oscillator.two_well = physics::TwoWell{{6.0}, {6.0e4}};
    expect_none_ignored(model);
  }
}

/// A term with the parameters of the effect's picture, on the first channel that it acts on.
std::optional<physics::Term> example_of(const physics::Effect& effect, const Model& model) {
  const physics::Card& card = effect.card();
  if (card.example.size() != card.parameters.size()) return {};
  physics::Term term{std::string(card.id), {}, {}, {}};
  if (card.relation == physics::Relation::sensor) {
    const auto try_place = [&](const physics::Place& place) {
      if (term.channel || !effect.acts_on(place)) return;
      term.channel = place.channel;
      term.from = place.from;
    };
    for (Channel channel : all_channels) {
      try_place({channel, {}});
      for (Channel from : all_channels) try_place({channel, from});
    }
  }
  if (!can_be_missing(effect, model, {term.channel, term.from})) return {};
  for (std::size_t i = 0; i < card.parameters.size(); ++i) {
    term.parameters[std::string(card.parameters[i].name)] = {card.example[i], 0.0};
  }
  return term;
}

class EffectsUncertainty : public testing::TestWithParam<const physics::Effect*> {};

TEST_P(EffectsUncertainty, IsUsed) {
  Model model = test::paper_rig(test::Law::coulomb, true);
  const std::optional<physics::Term> term = example_of(*GetParam(), model);
  if (!term) GTEST_SKIP() << "not for this rig, or without an example";
  model.terms.push_back(*term);
  std::vector<std::string> paths;
  for (const physics::ParameterCard& card : GetParam()->card().parameters) {
    const bool is_setting = card.fixed_default && !card.estimated;
    if (!is_setting) paths.push_back(physics::path_of(*term) + '.' + std::string(card.name));
  }
  expect_none_ignored(model, paths);
}

INSTANTIATE_TEST_SUITE_P(Catalogue, EffectsUncertainty,
                         testing::ValuesIn(physics::catalogue().begin(),
                                           physics::catalogue().end()),
                         [](const auto& each) { return std::string(each.param->card().id); });

}  // namespace
}  // namespace stickslip::observer
