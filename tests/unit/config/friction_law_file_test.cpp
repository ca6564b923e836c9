// SPDX-License-Identifier: Apache-2.0
// Laws of friction by name in model files.
#include <gtest/gtest.h>

#include <string>

#include "config/model_file.h"
#include "physics/friction_laws.h"
#include "physics/problem.h"

namespace stickslip::config {
namespace {

const std::string rig = R"(schema = 1
[oscillator]
excitation = "imposed"
[friction]
)";

std::string problem_of(const std::string& text) {
  try {
    parse_model(text, "m.toml");
  } catch (const InputError& error) {
    return error.problems().front().text();
  }
  return "";
}

TEST(FrictionLawFile, EveryLawIsReadAndWrittenWithItsParameters) {
  for (const physics::Effect* law : physics::friction_laws()) {
    const physics::Card& card = law->card();
    std::string text = rig + "law = \"" + std::string(card.id) + "\"\n";
    for (std::size_t i = 0; i < card.parameters.size(); ++i) {
      text += std::string(card.parameters[i].name) +
              " = { value = " + std::to_string(card.example[i] + 1.0e-4) + ", sigma = 0.01 }\n";
    }
    const physics::Model model = parse_model(text, "m.toml");
    EXPECT_EQ(physics::friction_coefficient(model).sigma, 0.01) << card.id;
    EXPECT_EQ(parse_model(model_text(model), "again.toml"), model) << card.id;
    EXPECT_NE(model_text(model).find("law = \"" + std::string(card.id) + "\""), std::string::npos);
    const physics::Term* term = physics::law_term(model);
    EXPECT_EQ(term == nullptr, model.friction.law != physics::FrictionLaw::none) << card.id;
    if (term == nullptr) continue;
    EXPECT_EQ(term->parameters.size(), card.parameters.size()) << card.id;
  }
}

TEST(FrictionLawFile, TermsFollowTheLaw) {
  const physics::Model model = parse_model(rig + R"(law = "dahl"
mu = 0.5
stiffness_n_m = 1000.0
[[physics]]
id = "asymmetric_friction"
asymmetry = 0.1
)",
                                           "m.toml");
  ASSERT_EQ(model.terms.size(), 2U);
  EXPECT_TRUE(model.terms.front().law);
  EXPECT_EQ(parse_model(model_text(model), "again.toml"), model);
}

TEST(FrictionLawFile, MistakesAreNamedWithTheirLine) {
  EXPECT_EQ(problem_of(rig + "law = \"lugra\"\n"),
            "m.toml:5:7: friction.law: expected \"none\", \"coulomb\", \"state_variable\", "
            "\"stribeck\", \"dahl\", \"lugre\", \"bouc_wen\", \"iwan\", \"gms\" or "
            "\"rate_and_state\", found \"lugra\": did you mean \"lugre\"?");
  const std::string missing = problem_of(rig + "law = \"dahl\"\nmu = 0.5\n");
  EXPECT_NE(missing.find("friction.stiffness_n_m is missing with law = \"dahl\""),
            std::string::npos)
      << missing;
  const std::string foreign =
      problem_of(rig + "law = \"dahl\"\nmu = 0.5\nstiffness_n_m = 100.0\nyield_spread = 0.5\n");
  EXPECT_NE(foreign.find("m.toml:8:1: friction.yield_spread has no meaning with law = \"dahl\""),
            std::string::npos)
      << foreign;
  const std::string negative =
      problem_of(rig + "law = \"dahl\"\nmu = 0.5\nstiffness_n_m = -100.0\n");
  EXPECT_NE(negative.find("m.toml:7:17: friction.stiffness_n_m"), std::string::npos) << negative;
  const std::string twice = problem_of(rig + R"(law = "lugre"
mu = 0.5
mu_static = 0.6
stribeck_speed_m_s = 0.01
stiffness_n_m = 1000.0
[[physics]]
id = "stribeck"
static_ratio = 1.2
stribeck_speed_m_s = 0.01
)");
  EXPECT_NE(twice.find("is in the law of [friction] already"), std::string::npos) << twice;
}

}  // namespace
}  // namespace stickslip::config
