// SPDX-License-Identifier: Apache-2.0
// An effect is one file: two effects from tests/data/effects/, one of the force balance and one of
// a sensor, are in the catalogue and work in the model file, the simulator, the observer,
// the diagnosis and the report of a program that is only linked with them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>

#include "config/model_file.h"
#include "diagnosis/diagnosis.h"
#include "diagnosis/report/effect_picture.h"
#include "diagnosis/report/effects_page.h"
#include "diagnosis/report/json.h"
#include "diagnosis/report/text.h"
#include "diagnosis/shape.h"
#include "observer/kalman_filter.h"
#include "physics/catalogue.h"
#include "physics/reading.h"
#include "physics/rig.h"
#include "physics/simulator.h"
#include "tests/unit/diagnosis/bench.h"
#include "tests/unit/physics/rigs.h"

namespace stickslip {
namespace {

using physics::find_effect;
using physics::Model;
using physics::Place;

constexpr double pitch_m = 0.03;
constexpr double cogging_n = 0.2;

physics::Term cogging_term() {
  return {"cogging", {}, {{"force_n", {cogging_n}}, {"pitch_m", {pitch_m}}}};
}
physics::Term characteristic_term(Channel channel, double cubic) {
  return {"cubic_characteristic", channel, {{"cubic", {cubic}}}};
}
Model with(Model model, const physics::Term& term) {
  model.terms.push_back(term);
  return model;
}

TEST(EffectsExtension, AreInTheCatalogueTogetherWithAllOthers) {
  for (const char* id : {"cogging", "cubic_characteristic", "stribeck", "load_over_time"}) {
    ASSERT_NE(find_effect(id), nullptr) << id;
    EXPECT_EQ(find_effect(id)->card().id, id);
  }
  EXPECT_EQ(physics::effect_list().size(), physics::catalogue().size());
  EXPECT_TRUE(physics::can_be_missing(*find_effect("cogging"), physics::test::bench()));
}

TEST(EffectsExtension, AreReadFromAModelFile) {
  const Model model = with(with(diagnosis::test::driven_mass(), cogging_term()),
                           characteristic_term(Channel::displacement, 40.0));
  const std::string text = config::model_text(model);
  EXPECT_THAT(text, testing::HasSubstr("cogging"));
  EXPECT_EQ(config::parse_model(text, "model.toml"), model);
}

TEST(EffectsExtension, ChangeTheSimulatedMotion) {
  const Model plain = diagnosis::test::driven_mass();
  const auto before = diagnosis::test::record(plain, 2.0, 1, false);
  const auto after = diagnosis::test::record(with(plain, cogging_term()), 2.0, 1, false);
  double largest = 0.0;
  for (std::size_t k = 0; k < before.frames.size(); ++k) {
    largest = std::max(largest, std::abs(after.frames[k][Channel::displacement] -
                                         before.frames[k][Channel::displacement]));
  }
  EXPECT_GT(largest, 1.0e-3);
}

TEST(EffectsExtension, DistortTheReadingsOfTheSimulatedRig) {
  constexpr double cubic = 40.0;
  const Model plain = diagnosis::test::driven_mass();
  const auto before = diagnosis::test::record(plain, 2.0, 1, false);
  const auto after = diagnosis::test::record(
      with(plain, characteristic_term(Channel::displacement, cubic)), 2.0, 1, false);
  for (std::size_t k = 0; k < before.frames.size(); ++k) {
    const double x = before.frames[k][Channel::displacement];
    EXPECT_NEAR(after.frames[k][Channel::displacement], x * (1.0 + cubic * x * x), 1.0e-15);
  }
}

TEST(EffectsExtension, AllowOneCharacteristicPerChannel) {
  const Model model = with(physics::test::bench(), characteristic_term(Channel::velocity, 0.1));
  const physics::Effect& effect = *find_effect("cubic_characteristic");
  EXPECT_FALSE(physics::can_be_missing(effect, model, {Channel::velocity, {}}));
  EXPECT_TRUE(physics::can_be_missing(effect, model, {Channel::displacement, {}}));
  EXPECT_FALSE(physics::can_be_missing(effect, model, {Channel::normal_load, {}}));
}

TEST(EffectsExtension, HaveACharacteristicThatIsInverted) {
  physics::ReadingLaws<double> laws;
  const double cubic = 3.0;
  const physics::Effect& effect = *find_effect("cubic_characteristic");
  effect.set_reading_law(laws, {Channel::velocity, {}}, &cubic);
  physics::ReadingLaw<double>& law = laws.of[index_of(Channel::velocity)];
  law.gain = 1.3;
  law.curvature = 0.05;
  for (const double value : {-0.8, -0.1, 0.0, 0.3, 0.9}) {
    const double reading = physics::reading_of(law, value, 0.0);
    const auto corrected = physics::correct_reading(law, reading);
    ASSERT_TRUE(corrected);
    EXPECT_NEAR(corrected->value, value, 1.0e-12);
    const double beyond = physics::correct_reading(law, reading + 1.0e-6)->value;
    EXPECT_NEAR(corrected->slope, (beyond - value) / 1.0e-6, 1.0e-4);
  }
  law.characteristic_parameters[0] = -3.0;  // turns back at r = 1/3
  EXPECT_FALSE(physics::correct_reading(law, 0.23));
}

// Root mean square error of the estimated friction force of a rig that is shaken at 2.9 Hz.
double estimation_error_n(const Model& real, const Model& assumed) {
  physics::RigSimulator rig(real, {.step_s = 2.5e-4, .seed = 3});
  observer::KalmanFilter filter(assumed, 1.0e-3);
  EXPECT_TRUE(filter.unsupported().empty()) << filter.unsupported();
  double sum = 0.0;
  constexpr int frames = 4000;
  for (int k = 1; k <= frames; ++k) {
    const double w = 2.0 * std::numbers::pi * 2.9;
    physics::Input input;
    input.base_displacement_m = 0.012 * std::sin(w * 1.0e-3 * k);
    input.base_acceleration_m_s2 = -w * w * input.base_displacement_m;
    rig.advance(1.0e-3, input);
    filter.update(rig.read());
    const double error = filter.estimate().friction_force_n - rig.truth().friction_force_n;
    if (k > frames / 2) sum += error * error;
  }
  return std::sqrt(sum / (frames / 2));
}

TEST(EffectsExtension, AreModelledByTheObserver) {
  Model model = physics::test::bench();
  for (const Channel channel : all_channels) {
    const bool is_force = channel == Channel::friction_force || channel == Channel::normal_load;
    model.sensors[index_of(channel)].noise_std = is_force ? 6.0e-4 : 3.0e-5;
  }
  model.sensors[index_of(Channel::velocity)].noise_std = 1.0e-3;
  const Model distorted = with(model, characteristic_term(Channel::velocity, 20.0));
  EXPECT_LT(estimation_error_n(distorted, distorted), 0.5 * estimation_error_n(distorted, model));
  Model cogged = model;
  cogged.terms.push_back({"cogging", {}, {{"force_n", {0.05}}, {"pitch_m", {0.01}}}});
  EXPECT_LT(estimation_error_n(cogged, cogged), 0.5 * estimation_error_n(cogged, model));
}

TEST(EffectsExtension, ArePlotted) {
  diagnosis::Experiment e;
  e.largest.displacement_m = 0.05;
  e.largest.velocity_m_s = 0.5;
  e.period_s = 0.005;
  e.samples = 1000;
  e.channel_std.fill(0.01);
  const std::vector<double> cubic = {40.0};
  const auto curves = diagnosis::portrait_of(*find_effect("cubic_characteristic"),
                                             {Channel::displacement, {}}, cubic, cubic, e, 0.0);
  ASSERT_EQ(curves.size(), 1U);
  const double at = curves[0].at.back();
  EXPECT_NEAR(curves[0].value.back(), at * (1.0 + 40.0 * at * at), 1.0e-12);
  const std::vector<double> cogging = {cogging_n, pitch_m};
  EXPECT_EQ(diagnosis::shape_of(*find_effect("cogging"), cogging, e).size(), 1U);
}

TEST(EffectsExtension, AreOnTheCataloguesPageWithAPicture) {
  const std::string page = report::effects_page();
  EXPECT_THAT(page, testing::HasSubstr("### cogging"));
  EXPECT_THAT(page, testing::HasSubstr("(effects/cubic_characteristic.svg)"));
  EXPECT_THAT(report::effects_list(), testing::HasSubstr("\ncogging "));
  for (const char* id : {"cogging", "cubic_characteristic"}) {
    EXPECT_THAT(report::effect_picture(*find_effect(id)), testing::StartsWith("<svg xmlns")) << id;
  }
}

TEST(EffectsExtension, AreFoundByTheDiagnosisAndReported) {
  const Model model = diagnosis::test::driven_mass();
  diagnosis::Options options;
  options.threads = 2;
  // Enough for an effect this large.
  options.criteria.effort.screening_windows = 8;
  options.criteria.effort.rough_fits = 4;
  options.criteria.effort.refinements = 2;
  options.criteria.effort.restarts = 0;
  options.criteria.effort.listed_finalists = 2;
  options.criteria.effort.unlisted_finalists = 1;
  options.criteria.effort.number_finalists = 0;
  const auto found = diagnosis::diagnose(
      {diagnosis::test::record(with(model, cogging_term()), 12.0)}, model, options);
  ASSERT_EQ(found.findings.size(), 1U) << report::report_text(found);
  const diagnosis::Finding& finding = found.findings.front();
  EXPECT_EQ(finding.effect, find_effect("cogging")) << report::report_text(found);
  ASSERT_EQ(finding.parameters.size(), 1U);
  EXPECT_NEAR(finding.parameters[0].value, cogging_n, 0.05 * cogging_n);
  const diagnosis::Experiment experiments[] = {
      diagnosis::make_experiment(diagnosis::test::record(model, 2.0), model)};
  const auto candidates = diagnosis::candidate_effects(model, experiments);
  EXPECT_TRUE(std::any_of(candidates.begin(), candidates.end(), [](const auto& candidate) {
    return candidate.name() == "cubic_characteristic of displacement";
  }));
  const auto json = report::report_json(found, {});
  EXPECT_EQ(json["findings"][0]["id"], "unlisted");
  EXPECT_EQ(json["findings"][0]["name"], "cogging");
  EXPECT_THAT(report::report_text(found), testing::HasSubstr("cogging"));
}

}  // namespace
}  // namespace stickslip
