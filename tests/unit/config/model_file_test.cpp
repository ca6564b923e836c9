// SPDX-License-Identifier: Apache-2.0
#include "config/model_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cctype>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "physics/catalogue.h"
#include "physics/model_consistency.h"
#include "physics/problem.h"
#include "physics/rig.h"
#include "physics/simulator.h"

namespace stickslip::config {
namespace {

using physics::Model;
using physics::Parameter;

/// The same cases in every run, unless RC_PARAMS is set.
const int seeded = setenv("RC_PARAMS", "seed=20260101 max_success=300", 0);

std::vector<std::string> problems_of(std::string_view text) {
  std::vector<std::string> lines;
  try {
    parse_model(text, "m");
  } catch (const InputError& error) {
    for (const Problem& problem : error.problems()) lines.push_back(problem.text());
  }
  return lines;
}

/// Doubles of any magnitude.
double positive() {
  return std::ldexp(1.0 + *rc::gen::inRange(0, 1 << 30) / 1073741824.0,
                    *rc::gen::inRange(-1000, 1000));
}

Parameter known_or_not(double value) {
  return {value, *rc::gen::arbitrary<bool>() ? 0.0 : positive()};
}
Parameter above_zero() { return known_or_not(positive()); }
Parameter not_negative() { return known_or_not(*rc::gen::inRange(0, 4) == 0 ? 0.0 : positive()); }
Parameter any() { return known_or_not(*rc::gen::arbitrary<bool>() ? positive() : -positive()); }

physics::Oscillator some_oscillator() {
  physics::Oscillator out;
  out.excitation = static_cast<physics::Excitation>(*rc::gen::inRange(0, 3));
  if (out.excitation == physics::Excitation::imposed) return out;
  out.mass_kg = above_zero();
  if (*rc::gen::arbitrary<bool>()) {
    out.natural_frequency_hz = above_zero();
  } else {
    out.stiffness_n_m = above_zero();
  }
  if (*rc::gen::arbitrary<bool>()) {
    out.damping_ratio = not_negative();
  } else {
    out.damping_n_s_m = not_negative();
  }
  if (*rc::gen::arbitrary<bool>()) out.two_well = physics::TwoWell{above_zero(), above_zero()};
  return out;
}

physics::NormalLoad some_load() {
  physics::NormalLoad out;
  out.law = static_cast<physics::NormalLoadLaw>(*rc::gen::inRange(0, 3));
  if (out.law != physics::NormalLoadLaw::measured) out.load_n = not_negative();
  if (out.law == physics::NormalLoadLaw::wedge) out.slope_per_m = any();
  return out;
}

physics::Friction some_friction() {
  physics::Friction out;
  out.law = static_cast<physics::FrictionLaw>(*rc::gen::inRange(0, 3));
  if (out.law == physics::FrictionLaw::none) return out;
  out.mu = not_negative();
  out.transition_speed_m_s = not_negative();
  if (out.law == physics::FrictionLaw::state_variable) out.rate_per_s = above_zero();
  return out;
}

physics::Sensor some_sensor() {
  physics::Sensor out;
  if (*rc::gen::arbitrary<bool>()) out.noise_std = positive();
  if (*rc::gen::arbitrary<bool>()) out.noise_correlation_s = positive();
  if (*rc::gen::arbitrary<bool>()) out.gain = above_zero();
  if (*rc::gen::arbitrary<bool>()) out.offset = any();
  if (*rc::gen::arbitrary<bool>()) out.delay_s = physics::Parameter{1.0e-3, 2.0e-4};
  const int count = *rc::gen::inRange(0, 3);
  for (int i = 0; i < count; ++i) {
    physics::Filter filter;
    filter.kind = static_cast<physics::FilterKind>(*rc::gen::inRange(0, 2));
    filter.order =
        filter.kind == physics::FilterKind::first_order_lowpass ? 1 : *rc::gen::inRange(1, 7);
    filter.cutoff_hz = above_zero();
    out.filters.push_back(filter);
  }
  return out;
}

Model some_model() {
  Model model;
  model.oscillator = some_oscillator();
  if (*rc::gen::arbitrary<bool>()) model.normal_load = some_load();
  model.friction = some_friction();
  if (model.oscillator.excitation != physics::Excitation::imposed && *rc::gen::arbitrary<bool>()) {
    model.load_cell =
        physics::LoadCell{above_zero(), above_zero(), not_negative(),
                          static_cast<physics::LoadCellDynamics>(*rc::gen::inRange(0, 2))};
  }
  if (model.normal_load && model.normal_load->law != physics::NormalLoadLaw::measured &&
      *rc::gen::arbitrary<bool>()) {
    model.normal_load_bridge = physics::NormalLoadBridge{0.01 * *rc::gen::inRange(-99, 100),
                                                         0.01 * *rc::gen::inRange(0, 101),
                                                         0.1 * *rc::gen::inRange(-1000, 1000)};
  }
  for (physics::Sensor& sensor : model.sensors) sensor = some_sensor();
  const auto some_channel = [] {
    return static_cast<Channel>(*rc::gen::inRange(0, static_cast<int>(channel_count)));
  };
  int states = 0;
  for (const physics::Effect* effect : physics::catalogue()) {
    if (model.terms.size() == physics::max_terms) break;
    if (states + effect->state_count() > physics::max_effect_states) continue;
    physics::Place place;
    if (effect->card().relation == physics::Relation::sensor) {
      place.channel = some_channel();
      if (effect->card().id == "crosstalk") place.from = some_channel();
    }
    if (*rc::gen::inRange(0, 8) != 0 || !physics::can_be_missing(*effect, model, place)) continue;
    physics::Term term;
    term.id = effect->card().id;
    term.channel = place.channel;
    term.from = place.from;
    for (const physics::ParameterCard& card : effect->card().parameters) {
      if (card.fixed_default && *rc::gen::arbitrary<bool>()) continue;
      term.parameters[std::string(card.name)] = above_zero();
    }
    model.terms.push_back(term);
    states += effect->state_count();
  }
  RC_PRE(physics::inconsistencies_of(model).empty());
  return model;
}

RC_GTEST_PROP(ModelFile, AWrittenModelReadsBackToTheBit, ()) {
  const Model model = some_model();
  const std::string text = model_text(model);
  const Model again = parse_model(text, "written");
  RC_ASSERT(again == model);
  RC_ASSERT(model_text(again) == text);
}

TEST(ModelFile, RandomCasesAreSeeded) { EXPECT_EQ(seeded, 0); }

TEST(ModelFile, ReadsEveryLaw) {
  const Model model = parse_model(R"(
schema = 1
[oscillator]
excitation = "base"
mass_kg = { value = 0.060, sigma = 0.0006 }
natural_frequency_hz = 3
damping_n_s_m = 0
[oscillator.two_well]
linear_n_m = { value = 2.0, sigma = 0.5 }
cubic_n_m3 = 4.0
[normal_load]
law = "wedge"
load_n = 0.15
slope_per_m = { value = -12.0, sigma = 1.0 }
[friction]
law = "state_variable"
mu = 0.8
transition_speed_m_s = 0
rate_per_s = 150.0
[load_cell]
mass_kg = 0.0126
natural_frequency_hz = 19.3
damping_ratio = 0.016
dynamics = "quasi_static"
[sensors.velocity]
noise_std = 2.0e-5
filters = [ { kind = "butterworth_lowpass", order = 4, cutoff_hz = 25.0 },
            { kind = "first_order_lowpass", cutoff_hz = 150 } ]
[[physics]]
id = "quadratic_drag"
drag_n_s2_m2 = { value = 7.5, sigma = 0.5 }
[[physics]]
id = "bias_force"
force_n = 1
)",
                                  "m");
  EXPECT_EQ(model.oscillator.mass_kg, (Parameter{0.06, 0.0006}));
  EXPECT_EQ(model.oscillator.natural_frequency_hz, (Parameter{3.0, 0.0}));
  EXPECT_EQ(model.oscillator.damping_n_s_m, (Parameter{0.0, 0.0}));
  EXPECT_FALSE(model.oscillator.stiffness_n_m || model.oscillator.damping_ratio);
  EXPECT_EQ(model.oscillator.two_well, (physics::TwoWell{{2.0, 0.5}, {4.0, 0.0}}));
  EXPECT_EQ(model.normal_load,
            (physics::NormalLoad{physics::NormalLoadLaw::wedge, {0.15, 0.0}, {-12.0, 1.0}}));
  EXPECT_EQ(model.friction,
            (physics::Friction{
                physics::FrictionLaw::state_variable, {0.8, 0.0}, {0.0, 0.0}, {150.0, 0.0}}));
  EXPECT_EQ(model.load_cell->dynamics, physics::LoadCellDynamics::quasi_static);
  const physics::Sensor& velocity = model.sensors[index_of(Channel::velocity)];
  EXPECT_EQ(velocity.noise_std, 2.0e-5);
  ASSERT_EQ(velocity.filters.size(), 2U);
  EXPECT_EQ(velocity.filters[0],
            (physics::Filter{physics::FilterKind::butterworth_lowpass, 4, 25.0}));
  EXPECT_EQ(velocity.filters[1],
            (physics::Filter{physics::FilterKind::first_order_lowpass, 1, 150.0}));
  EXPECT_FALSE(model.sensors[index_of(Channel::displacement)].noise_std);
  ASSERT_EQ(model.terms.size(), 2U);
  EXPECT_EQ(model.terms[0].parameters.at("drag_n_s2_m2"), (Parameter{7.5, 0.5}));
  EXPECT_EQ(model.terms[1].id, "bias_force");
}

TEST(ModelFile, AnImposedMotionNeedsNoOtherKeys) {
  const Model model = parse_model("schema = 1\noscillator.excitation = \"imposed\"\n", "m");
  EXPECT_EQ(model.oscillator.excitation, physics::Excitation::imposed);
  EXPECT_EQ(model.friction.law, physics::FrictionLaw::none);
  EXPECT_FALSE(model.normal_load || model.load_cell);
}

TEST(ModelFile, AMisspeltKeyIsNotReportedMissing) {
  const auto problems = problems_of(
      "schema = 1\n[oscillator]\nexcitation = \"force\"\nmas_kg = 1\nstiffness_n_m = 1\n"
      "damping_ratio = 0\n");
  EXPECT_THAT(problems,
              testing::ElementsAre("m:4:1: unknown key oscillator.mas_kg: did you mean mass_kg?"));
}

TEST(ModelFile, AProblemIsOneLineForAnyContent) {
  for (const auto& line :
       problems_of("schema = 1\n[\"a\\nb\\u001b[2J\"]\noscillator.excitation = \"\\r\\n\"\n")) {
    for (const char c : line) EXPECT_FALSE(std::iscntrl(static_cast<unsigned char>(c))) << line;
  }
}

TEST(ModelFile, ATooLongSensorChainIsRefused) {
  const std::string filter = "{ kind = \"butterworth_lowpass\", order = 5, cutoff_hz = 25.0 }";
  const std::string model =
      "schema = 1\noscillator.excitation = \"imposed\"\nsensors.displacement.filters = [" + filter +
      ", " + filter;
  EXPECT_NO_THROW(physics::RigSimulator{parse_model(model + "]", "m")});
  EXPECT_THAT(problems_of(model + "," + filter + "]"),
              testing::ElementsAre(testing::HasSubstr("more than 12 poles")));
}

TEST(ModelFile, ModelsOfRealMachinesAreRead) {
  const char* shared = std::getenv("STICKSLIP_SHARED");
  if (shared == nullptr) GTEST_SKIP() << "STICKSLIP_SHARED names no folder of recordings";
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(shared)) {
    if (entry.path().filename() != "model.toml") continue;
    const Model model = load_model(entry.path());
    EXPECT_EQ(parse_model(model_text(model), "written"), model) << entry.path();
    ++count;
  }
  EXPECT_GT(count, 0U);
}

}  // namespace
}  // namespace stickslip::config
