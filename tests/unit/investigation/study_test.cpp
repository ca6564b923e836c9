// SPDX-License-Identifier: Apache-2.0
#include "tools/investigation/study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>

#include "config/model_file.h"
#include "diagnosis/shooting.h"
#include "physics/problem.h"
#include "tools/investigation/investigation.h"
#include "tools/investigation/page.h"

namespace stickslip::investigation {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class StudyTest : public testing::Test {
 protected:
  StudyTest() : folder(fs::path(testing::TempDir()) / ("study-" + std::to_string(::getpid()))) {
    fs::remove_all(folder);
  }
  ~StudyTest() override { fs::remove_all(folder); }
  fs::path folder;
};

RigFacts facts() {
  RigFacts out;
  out.name = "a <rig>";
  out.limits = {0.015, 0.5, std::numeric_limits<double>::infinity()};
  out.ranges.high[index_of(Channel::friction_force)] = 0.25;
  return with_displacement_range(out);
}

Study whole_study() {
  Study out;
  out.facts = facts();
  out.rig = out.facts.name;
  out.model_sha256 = "abc";
  out.settings.seed = 7;
  out.settings.usual_runs = true;
  Step step;
  step.name = "run-01";
  step.question.words = "a sine & more";
  step.question.plan = {design::Family::hold, 0.1, 0.2, {0.3, 0.4, 0.5}};
  step.question.duration_s = 13.98;
  step.question.expected = {{"a", "b", 12.5, 0.5}};
  step.question.gain = 0.25;
  step.recording_sha256 = "def";
  step.answered = true;
  step.verdict = "missing_physics";
  step.partial = true;
  step.findings = {"a"};
  step.least_probability = 1.0 / 3.0;
  step.standing = {{"a", "a", "It is a.", 1.0 / 3.0}, {"b", "b", "It is b.", 2.0 / 3.0}};
  out.steps.push_back(step);
  step.name = "run-02";
  step.answered = false;
  out.steps.push_back(step);
  out.ending = Ending::budget;
  out.ending_words = "the budget is used";
  return out;
}

TEST_F(StudyTest, IsTheSameAfterItWasWrittenAndRead) {
  const Study study = whole_study();
  save(study, folder);
  EXPECT_EQ(study_text(read_study(folder)), study_text(study));
  EXPECT_DOUBLE_EQ(study.rig_time_s(), 2.0 * (13.98 + study.settings.overhead_s));
}

TEST_F(StudyTest, AFileThatIsNoneIsAnErrorThatNamesIt) {
  for (const char* text : {"{", "{}", "[1]", "{\"rig\": 3}"}) {
    write_whole(json_file(folder), text);
    try {
      read_study(folder);
      ADD_FAILURE() << text;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("study.json: is no study")) << text;
    }
  }
}

TEST_F(StudyTest, ThePageHasEveryQuestionItsLimitsAndItsAnswer) {
  const std::string page = page_of(whole_study());
  for (const char* text : {"a &lt;rig&gt;", "a sine &amp; more", "0.015 m", "0.25 N", "run-02",
                           "not diagnosed yet", "It is a.", "the budget is used", "33.3 %",
                           "Result after run-01: part of the missing physics, a, with a "
                           "probability of 33.3 %; also possible: "
                           "b (66.7 %).",
                           "Answer: part of the missing physics"}) {
    EXPECT_THAT(page, HasSubstr(text));
  }
  EXPECT_THAT(page, testing::Not(HasSubstr("It is b."))) << "not a finding";
}

std::string model_text() {
  return config::model_text(
      config::load_model(STICKSLIP_SOURCE_DIR "/config/models/simulated.toml"));
}

std::string refusal(const fs::path& folder, const std::string& model, const RigFacts& rig) {
  try {
    opened(folder, model, rig, {});
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

TEST_F(StudyTest, IsTakenUpAgainWithTheSameRigAndModelOnly) {
  StudySettings settings;
  settings.seed = 3;
  Study study = opened(folder, model_text(), facts(), settings);
  study.steps = whole_study().steps;
  study.ending = Ending::budget;
  save(study, folder);

  settings.seed = 4;
  settings.budget_s = 1000.0;
  const Study again = opened(folder, model_text(), facts(), settings);
  EXPECT_EQ(again.steps.size(), 2U);
  EXPECT_EQ(again.ending, Ending::open);
  EXPECT_EQ(again.settings.seed, 3U) << "numbers are those of the study";
  EXPECT_EQ(again.settings.budget_s, 1000.0);

  EXPECT_THAT(refusal(folder, model_text() + "# another\n", facts()), HasSubstr("another model"));
  RigFacts other = facts();
  other.name = "other";
  EXPECT_THAT(refusal(folder, model_text(), other), HasSubstr("another rig"));
  EXPECT_THAT(refusal(folder.parent_path(), model_text(), facts()), HasSubstr("not empty"));
}

/// A rig whose runs end before they are made.
class FaultyRig final : public Rig {
 public:
  const RigFacts& facts() const override { return facts_; }
  protocol::Recording run(const design::Drive&, std::stop_token,
                          const std::function<void(const std::string&)>&) override {
    ++runs;
    throw InputError(Problem{"the rig", 0, 0, "faulted during the run"});
  }
  int runs = 0;

 private:
  RigFacts facts_ = investigation::facts();
};

TEST_F(StudyTest, ARunIsShownBeforeItIsMadeAndNoneIsMadeUnconfirmed) {
  FaultyRig rig;
  std::string shown;
  bool confirmed = false;
  const Dialogue dialogue{[&shown](const std::string& text) { shown += text; },
                          [&] {
                            EXPECT_THAT(shown, HasSubstr("base velocity: at most"));
                            EXPECT_TRUE(fs::exists(folder / "run-01" / "drive.svg"));
                            return confirmed;
                          },
                          {}};
  const Study declined =
      investigate(opened(folder, model_text(), rig.facts(), {}), folder, rig, dialogue, {});
  EXPECT_EQ(declined.ending, Ending::declined);
  EXPECT_TRUE(declined.steps.empty());
  EXPECT_EQ(rig.runs, 0);

  // A run that ends with a fault is not part of the study, which can be taken up again.
  confirmed = true;
  for (int i = 1; i <= 2; ++i) {
    const Study study = opened(folder, model_text(), rig.facts(), {});
    EXPECT_TRUE(study.steps.empty());
    EXPECT_THROW(investigate(study, folder, rig, dialogue, {}), InputError);
    EXPECT_EQ(rig.runs, i);
  }
}

}  // namespace
}  // namespace stickslip::investigation
