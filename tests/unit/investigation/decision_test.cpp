// SPDX-License-Identifier: Apache-2.0
#include "tools/investigation/decision.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stickslip::investigation {
namespace {

using testing::HasSubstr;

Step step(const char* verdict, std::vector<std::string> findings, double least_probability,
          std::vector<Standing> standing) {
  Step out;
  out.name = "run-01";
  out.answered = true;
  out.verdict = verdict;
  out.findings = std::move(findings);
  out.least_probability = least_probability;
  out.standing = std::move(standing);
  out.question.duration_s = 12.0;
  return out;
}

Step open_step() {
  return step("missing_physics", {"cubic_stiffness"}, 0.6,
              {{"cubic_stiffness", "cubic_stiffness", "", 0.6}, {"backlash", "backlash", "", 0.4}});
}

NextRun run_with(double gain) {
  NextRun out;
  out.question.duration_s = 10.0;
  out.question.gain = gain;
  return out;
}

Study study_of(std::vector<Step> steps) {
  Study out;
  out.steps = std::move(steps);
  return out;
}

Decision decide_after(const Study& study, const std::optional<NextRun>& next) {
  return decide(study, study.steps.size(), next);
}

TEST(Decision, AStudyBeginsWithARunAndGoesOnWhileItLearns) {
  EXPECT_EQ(decide_after(study_of({}), run_with(0.0)).ending, Ending::open);
  EXPECT_EQ(decide_after(study_of({open_step()}), run_with(0.3)).ending, Ending::open);
}

TEST(Decision, EndsWhenEveryFindingIsCertain) {
  Step last = open_step();
  last.findings = {"cubic_stiffness", "drift of velocity"};
  last.least_probability = 0.9899;
  EXPECT_EQ(decide_after(study_of({last}), run_with(0.3)).ending, Ending::open);
  last.least_probability = 0.99;
  const Decision decision = decide_after(study_of({last}), std::nullopt);
  EXPECT_EQ(decision.ending, Ending::named);
  EXPECT_THAT(decision.words, HasSubstr("cubic_stiffness and drift of velocity"));
  EXPECT_THAT(decision.words, HasSubstr("each with a probability of at least 99 %"));
  last.findings = {"friction_memory"};
  last.least_probability = 1.0;
  EXPECT_THAT(decide_after(study_of({last}), std::nullopt).words,
              HasSubstr("friction_memory, with a probability of more than 99.9 %"));
}

TEST(Decision, GoesOnWhereFindingsLeaveMoreThanTheNoise) {
  Step last = step("missing_physics", {"bias_force"}, 1.0, {{"bias_force", "bias_force", "", 1.0}});
  last.partial = true;
  EXPECT_EQ(decide_after(study_of({last}), run_with(0.0)).ending, Ending::open);
  EXPECT_EQ(decide_after(study_of({last, last, last}), run_with(0.0)).ending, Ending::no_gain);
}

TEST(Decision, TheUsualRunsAreMadeUntilThePhysicsIsNamed) {
  Study study = study_of({open_step(), open_step(), open_step(), open_step()});
  study.settings.usual_runs = true;
  EXPECT_EQ(decide_after(study, run_with(0.0)).ending, Ending::open);
  EXPECT_EQ(decide_after(study, std::nullopt).ending, Ending::no_gain);
}

TEST(Decision, NothingIsMissingOnlyAfterTwoRuns) {
  const Step calm = step("consistent", {}, 1.0, {{"nothing", "nothing is missing", "", 1.0}});
  EXPECT_EQ(decide_after(study_of({calm}), run_with(0.0)).ending, Ending::open);
  const Decision decision = decide_after(study_of({calm, calm}), std::nullopt);
  EXPECT_EQ(decision.ending, Ending::named);
  EXPECT_THAT(decision.words, HasSubstr("nothing is missing"));
}

TEST(Decision, EndsWhenTheBestRunWouldSeparateTooLittle) {
  const Decision decision = decide_after(study_of({open_step()}), run_with(0.049));
  EXPECT_EQ(decision.ending, Ending::no_gain);
  EXPECT_THAT(decision.words, HasSubstr("4.9 %"));
  EXPECT_EQ(decide_after(study_of({open_step()}), std::nullopt).ending, Ending::no_gain);
}

// Some runs of other kinds show physics that no hypothesis explains; ever more do not.
TEST(Decision, EndsWhenOneHypothesisIsLeftThatExplainsNothing) {
  const Step lost = step("unexplained", {}, 1.0, {{"nothing", "nothing is missing", "", 1.0}});
  EXPECT_EQ(decide_after(study_of({lost}), run_with(0.0)).ending, Ending::open);
  EXPECT_EQ(decide_after(study_of({lost, lost}), run_with(0.0)).ending, Ending::open);
  EXPECT_EQ(decide_after(study_of({lost, lost, lost}), run_with(0.0)).ending, Ending::no_gain);
}

TEST(Decision, NoRunExceedsTheBudget) {
  Study study = study_of({open_step()});  // 15 s with what a run takes beside its drive
  study.settings.budget_s = 28.0;
  EXPECT_EQ(decide_after(study, run_with(0.3)).ending, Ending::open);
  study.settings.budget_s = 27.9;
  const Decision decision = decide_after(study, run_with(0.3));
  EXPECT_EQ(decision.ending, Ending::budget);
  EXPECT_THAT(decision.words, HasSubstr("15 of 27.9 s are used"));
}

}  // namespace
}  // namespace stickslip::investigation
