// SPDX-License-Identifier: Apache-2.0
#include "tools/interview/interview.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <string>
#include <vector>

#include "physics/problem.h"

namespace stickslip::interview {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// A person who types these lines.
struct Person {
  std::deque<std::string> lines;
  std::string shown = {};

  Ask ask() {
    return [this](const std::string& text) -> std::optional<std::string> {
      shown += text;
      if (lines.empty()) return std::nullopt;
      std::string line = lines.front();
      lines.pop_front();
      return line;
    };
  }
};

Measured channels(const std::vector<Channel>& list) {
  Measured out{};
  for (Channel channel : list) out[index_of(channel)] = true;
  return out;
}

std::string refusal_of(const Setup& setup) {
  try {
    (void)interviewed(setup);
  } catch (const InputError& error) {
    return error.problems().front().message;
  }
  return "";
}

TEST(Interview, AsksEightQuestions) {
  Person person{{"base", "60 g", "2.4 Hz", "0.015", "0.15 N", "coulomb 0.8",
                 "displacement 2e-5, friction_force, base_displacement", "12.6 g, 19.3 Hz"}};
  const Draft draft = interviewed({{}, {}, person.ask()});
  for (const char* title : {"1/8  Excitation", "2/8  Mass", "8/8  Load cell"}) {
    EXPECT_THAT(person.shown, HasSubstr(title));
  }
  EXPECT_EQ(draft.model.oscillator.mass_kg, (physics::Parameter{0.06, 0.0006}));
  EXPECT_EQ(draft.model.oscillator.natural_frequency_hz, (physics::Parameter{2.4, 0.048}));
  EXPECT_EQ(draft.model.friction.mu, (physics::Parameter{0.8, 0.16}));
  EXPECT_EQ(draft.model.load_cell->mass_kg, (physics::Parameter{0.0126, 0.0}));
  EXPECT_EQ(draft.model.sensors[index_of(Channel::displacement)].noise_std, 2e-5);
  EXPECT_TRUE(draft.measures(Channel::friction_force));
  EXPECT_FALSE(draft.measures(Channel::velocity));
}

TEST(Interview, ProposesWhatTheRecordingHas) {
  Person person{{"", "95 kg", "none", "300 N s/m", "", "", ""}};
  const Measured recorded = channels({Channel::displacement, Channel::drive_force});
  const Draft draft = interviewed({{}, recorded, person.ask()});
  EXPECT_EQ(draft.model.oscillator.excitation, physics::Excitation::force);
  EXPECT_EQ(draft.measured, recorded);
  EXPECT_FALSE(draft.model.normal_load);
  EXPECT_THAT(person.shown, HasSubstr("Enter: displacement, drive_force"));
  EXPECT_THAT(person.shown, Not(HasSubstr("Load cell"))) << "no friction_force is recorded";
}

TEST(Interview, AsksAgainAfterAnAnswerThatCannotBeUsed) {
  Person person{{"force", "", "heavy", "95 kg", "2 Hz", "", "", "", ""}};
  const Draft draft = interviewed({{}, {}, person.ask()});
  EXPECT_THAT(person.shown, HasSubstr("This has no usual value"));
  EXPECT_THAT(person.shown, HasSubstr("expected a number, found \"heavy\""));
  EXPECT_EQ(draft.model.oscillator.mass_kg.value, 95.0);
  EXPECT_EQ(draft.model.oscillator.damping_ratio, (physics::Parameter{0.02, 0.01}));
}

TEST(Interview, SkipsWhatAnImposedMotionDoesNotHave) {
  Person person{{"imposed", "none", "coulomb 2 N", ""}};
  const Draft draft = interviewed({{}, {}, person.ask()});
  EXPECT_THAT(person.shown, Not(HasSubstr("Mass")));
  EXPECT_TRUE(draft.measures(Channel::friction_force));
}

TEST(Interview, DoesNotAskWhatIsAnsweredBeforehand) {
  Person person{{"2.4 Hz", "", "", "", ""}};
  (void)interviewed({{{"--excitation", "force"}, {"--mass", "1 kg"}}, {}, person.ask()});
  EXPECT_THAT(person.shown, Not(HasSubstr("1/8")));
  EXPECT_THAT(person.shown, Not(HasSubstr("2/8")));
  EXPECT_EQ(person.shown.find("Eight questions"), 0U);
  EXPECT_EQ(person.shown.rfind("Eight questions"), 0U) << "once";
}

TEST(Interview, EndsWithTheInput) {
  Person person{{"base"}};
  EXPECT_THAT(refusal_of({{}, {}, person.ask()}), HasSubstr("--mass: nothing is written"));
}

TEST(Interview, NamesEveryMissingOptionWithoutAPerson) {
  const std::string text = refusal_of({{{"--mass", "1 kg"}, {"--spring", "none"}}, {}, {}});
  for (const char* option : {"--excitation", "--damping", "--load", "--friction", "--sensors"}) {
    EXPECT_THAT(text, HasSubstr(option));
  }
  EXPECT_THAT(text, Not(HasSubstr("--mass")));
}

TEST(Interview, TakesTheSensorsOfTheRecordingWithoutAPerson) {
  const Measured recorded = channels({Channel::displacement, Channel::drive_force});
  const Draft draft = interviewed({{{"--excitation", "force"},
                                    {"--mass", "1 kg"},
                                    {"--spring", "none"},
                                    {"--damping", "none"},
                                    {"--load", "none"},
                                    {"--friction", "none"}},
                                   recorded,
                                   {}});
  EXPECT_EQ(draft.measured, recorded);
}

TEST(Interview, RefusesAnswersThatContradictEachOtherOrTheRecording) {
  using Answers = std::map<std::string, std::string>;
  const Answers cart = {{"--excitation", "force"}, {"--mass", "1 kg"},
                        {"--spring", "none"},      {"--damping", "none"},
                        {"--load", "none"},        {"--friction", "none"},
                        {"--load-cell", "none"},   {"--sensors", "displacement"}};
  ASSERT_EQ(refusal_of({cart, {}, {}}), "");
  const Measured recorded = channels({Channel::displacement, Channel::drive_force});
  struct Case {
    std::string option, answer, refusal;
    Measured recorded = {};
  };
  for (const Case& each : std::vector<Case>{
           {"--excitation", "imposed", "--mass: does not apply", {}},
           {"--excitation", "base", "needs no base_displacement", recorded},
           {"--excitation", "base", "expected base_displacement among the sensors", {}},
           {"--mass", "-1 kg", "above 0", {}},
           {"--spring", "0 Hz", "\"none\" is a mass without a spring", {}},
           {"--damping", "0.1", "without a spring there is no damping ratio", {}},
           {"--damping", "-2 N s/m", "0 or more", {}},
           {"--load", "measured", "needs no normal_load", recorded},
           {"--load", "measured", "expected normal_load among the sensors", {}},
           {"--friction", "coulomb", "\"coulomb MU\"", {}},
           {"--friction", "coulomb 0.8, 3 1/s", "\"coulomb MU\"", {}},
           {"--friction", "state_variable 0.8, 0 1/s", "above 0", {}},
           {"--friction", "none 0.8", "none, \"coulomb MU\"", {}},
           {"--friction", "viscous 3", "none, \"coulomb MU\"", {}},
           {"--friction", "dahl", "\"dahl MU, ...\" with mu NUMBER, stiffness_n_m NUMBER", {}},
           {"--friction", "dahl 0.8", "expected also stiffness_n_m NUMBER, found", {}},
           {"--friction", "dahl 0.8, stiffness 4000", "(mu, stiffness_n_m) with its number", {}},
           {"--friction", "dahl 0.8, stiffness_n_m 4 N", "a number in N/m", {}},
           {"--friction", "dahl 0.8, stiffness_n_m 0", "above 0", {}},
           {"--sensors", "displacement, velocity", "sensors that the recording has", recorded},
           {"--sensors", "displacment 1e-5", "names out of displacement, velocity", {}},
           {"--sensors", "displacement 1e-5 N", "a number in m", {}},
           {"--sensors", "", "expected displacement among", {}},
           {"--load-cell", "12 g, 19 Hz", "with a sensor friction_force", {}}}) {
    Answers answers = cart;
    answers[each.option] = each.answer;
    EXPECT_THAT(refusal_of({answers, each.recorded, {}}), HasSubstr(each.refusal))
        << each.option << ' ' << each.answer;
  }
}

}  // namespace
}  // namespace stickslip::interview
