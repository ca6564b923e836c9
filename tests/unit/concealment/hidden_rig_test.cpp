// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/hidden_rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stickslip::concealment {
namespace {

using testing::HasSubstr;
using testing::Not;

Case driven_case() {
  Case out;
  physics::Model& model = out.declared;
  model.oscillator.mass_kg = {0.06, 0.001};
  model.oscillator.natural_frequency_hz = physics::Parameter{2.4, 0.05};
  model.oscillator.damping_ratio = physics::Parameter{0.02, 0.004};
  model.sensors[index_of(Channel::displacement)].noise_std = 1.0e-5;
  out.recording.channels = 1U << index_of(Channel::displacement);
  out.truth.name = "case-001";
  out.truth.seed = 5;
  out.truth.sample_rate_hz = 500.0;
  out.truth.parameters = {{"oscillator.mass_kg", 0.0612},
                          {"oscillator.stiffness_n_m", 14.1},
                          {"oscillator.damping_n_s_m", 0.03}};
  out.truth.noise_std = {{"displacement_m", 3.0e-5}};
  TrueEffect hidden;
  hidden.id = "cubic_stiffness";
  hidden.parameters["k3_n_m3"].value = 7000.0;
  out.truth.effects.push_back(hidden);
  return out;
}

TEST(HiddenRig, TheTruthHasTheDrawnNumbersAndTheHiddenPhysics) {
  const auto rig = rig_of(driven_case());
  ASSERT_TRUE(rig);
  EXPECT_EQ(rig->declared, driven_case().declared);
  const physics::Oscillator& actual = rig->actual.oscillator;
  EXPECT_EQ(actual.mass_kg, (physics::Parameter{0.0612, 0.0}));
  EXPECT_FALSE(actual.natural_frequency_hz || actual.damping_ratio);
  EXPECT_EQ(actual.stiffness_n_m->value, 14.1);
  EXPECT_EQ(actual.damping_n_s_m->value, 0.03);
  EXPECT_EQ(rig->actual.sensors[index_of(Channel::displacement)].noise_std, 3.0e-5);
  ASSERT_EQ(rig->actual.terms.size(), 1U);
  EXPECT_EQ(rig->actual.terms[0].parameters.at("k3_n_m3").value, 7000.0);
}

TEST(HiddenRig, TheConfigurationNamesTheTruthAndDoesNotContainIt) {
  const std::string text = rig_text(*rig_of(driven_case()), "../truth/case-001.toml");
  EXPECT_THAT(text, HasSubstr("truth = \"../truth/case-001.toml\""));
  EXPECT_THAT(text, HasSubstr("displacement_m = 0.012"));
  EXPECT_THAT(text, HasSubstr("velocity = true")) << "absent, as in the recording of the case";
  EXPECT_THAT(text, Not(HasSubstr("\ndisplacement = true")));
  EXPECT_THAT(text, Not(HasSubstr("cubic")));
  EXPECT_THAT(text, Not(HasSubstr("14.1")));
}

TEST(HiddenRig, ThereIsNoneOfPhysicsBeyondTheCatalogueOrWithoutADrive) {
  Case made = driven_case();
  made.truth.effects[0].id = "unlisted";
  EXPECT_FALSE(rig_of(made));
  made = driven_case();
  made.truth.effects[0].parameters.clear();
  EXPECT_FALSE(rig_of(made));
  made = driven_case();
  made.declared.oscillator.excitation = physics::Excitation::imposed;
  EXPECT_FALSE(rig_of(made));
}

}  // namespace
}  // namespace stickslip::concealment
