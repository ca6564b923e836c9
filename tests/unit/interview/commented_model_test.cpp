// SPDX-License-Identifier: Apache-2.0
// Every combination of answers makes a model file that the parser reads back to the same model.
#include "tools/interview/commented_model.h"

#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "config/document.h"
#include "config/model_file.h"
#include "physics/problem.h"
#include "tools/interview/questions.h"

namespace stickslip::interview {
namespace {

/// Answers to each question, in the order of the questions.
const std::vector<std::vector<std::string>> answers = {
    {"base", "force", "imposed"},
    {"60 g +- 1 %", "95 kg +- 0"},
    {"none", "2.4 Hz +- 0.05", "1190 N/m"},
    {"none", "0.015 +- 0.005", "200 N s/m +- 50 %"},
    {"none", "measured", "0.15 N +- 0.01"},
    {"none", "coulomb 0.8 +- 0.1", "coulomb 20 N", "state_variable 0.8",
     "state_variable 0.8, 40 1/s", "dahl 0.8, stiffness_n_m 4000 N/m +- 10 %",
     "rate_and_state 0.6, direct_effect 0.01, evolution_effect -0.015, slip_length_m 1e-5 m",
     "lugre 0.8, mu_static 1, stribeck_speed_m_s 0.02, stiffness_n_m 4000, viscosity_n_s_m 0"},
    {"displacement 2e-5, base_displacement, drive_force, normal_load",
     "displacement, velocity 5e-4, friction_force, normal_load 3e-4, base_displacement, "
     "drive_force 0.2"},
    {"none", "12.6 g, 19.3 Hz, 0.016", "0.0126 kg +- 1 %, 19.3 Hz +- 2 %, quasi_static"},
};

void expect_round_trip(const Draft& draft) {
  const std::string text = commented_model(draft);
  try {
    EXPECT_EQ(config::parse_model(text, "my-rig.toml"), draft.model) << text;
  } catch (const InputError& error) {
    ADD_FAILURE() << error.problems().front().text() << '\n' << text;
  }
}

/// Goes through all answers from question `index` on; returns the number of models.
std::size_t expect_from(std::size_t index, const Draft& draft) {
  if (index == question_count) {
    expect_round_trip(draft);
    return 1;
  }
  const Question& question = questions()[index];
  if (!question.applies(draft)) return expect_from(index + 1, draft);
  std::size_t models = 0;
  for (const std::string& answer : answers[index]) {
    Draft next = draft;
    if (question.take(next, answer).empty()) models += expect_from(index + 1, next);
  }
  return models;
}

TEST(CommentedModel, IsReadBackWhateverTheAnswers) { EXPECT_GT(expect_from(0, {}), 1500U); }

Draft example() {
  Draft draft;
  for (std::size_t i = 0; i < question_count; ++i) {
    const std::string& answer = i == 0 ? answers[i].front() : answers[i].back();
    EXPECT_EQ(questions()[i].take(draft, answer), "");
  }
  return draft;
}

TEST(CommentedModel, ExplainsEveryKeyAndFitsAScreen) {
  std::istringstream lines(commented_model(example()));
  std::string before;
  for (std::string line; std::getline(lines, line); before = line) {
    EXPECT_LE(line.size(), 105U) << line;
    const bool key = line.find(" = ") != std::string::npos && !line.starts_with("#");
    // Frequency and damping ratio of the load cell share a comment.
    const bool explained = before.starts_with("#") || before.starts_with("natural_frequency_hz") ||
                           line.find("  # ") != std::string::npos;
    EXPECT_TRUE(!key || explained) << line;
  }
}

TEST(CommentedModel, IsKnownAsAModel) {
  EXPECT_EQ(config::kind_of(commented_model(example())), config::FileKind::model);
}

TEST(CommentedModel, NamesSensorsOfUnknownNoise) {
  Draft draft;
  draft.measured[index_of(Channel::drive_force)] = true;
  draft.model.oscillator.excitation = physics::Excitation::imposed;
  const std::string text = commented_model(draft);
  EXPECT_NE(text.find("[sensors.drive_force]"), std::string::npos);
  EXPECT_NE(text.find("# noise_std = ...  # N; unknown: estimated"), std::string::npos);
}

}  // namespace
}  // namespace stickslip::interview
