#include "daemon/alarm_analyser.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/unit/observer/bench.h"

namespace stickslip::daemon {
namespace {

using observer::Explanation;
using physics::Relation;

/// A rig whose mu is 20 % larger than the model's from the start.
std::vector<Sample> samples_of(double duration_s) {
  const physics::Model model = observer::test::paper_rig(observer::test::Law::coulomb);
  physics::Model real = model;
  real.friction.mu.value *= 1.2;
  const observer::test::ModulatedBase drive{.amplitude_m = 0.014, .depth = 0.3};
  std::vector<Sample> out;
  for (const auto& moment :
       observer::test::run_observer(real, model, {.duration_s = duration_s, .drive = drive})) {
    Sample sample;
    sample.frame = moment.frame;
    out.push_back(sample);
  }
  return out;
}

ModelVerdict alarm() {
  ModelVerdict out;
  out.status = observer::ModelStatus::broken;
  out.since_ns = 1'000'000'000;
  out.reported_ns = 3'000'000'000;
  return out;
}

class AlarmAnalyserTest : public testing::Test {
 protected:
  void put(const std::vector<Sample>& samples, std::size_t from, std::size_t to) {
    for (std::size_t k = from; k < to; k += 10) {
      ASSERT_EQ(analyser_.write_block(std::span(samples).subspan(k, 10)), WriteResult::ok);
    }
  }

  AlarmAnalyser analyser_{observer::test::paper_rig(observer::test::Law::coulomb), 1.0e-3};
};

TEST_F(AlarmAnalyserTest, AnalysesWhenEnoughFramesHaveFollowedTheAlarm) {
  const auto samples = samples_of(6.0);
  put(samples, 0, 3000);
  analyser_.request(alarm());
  put(samples, 3000, 4900);
  EXPECT_FALSE(analyser_.next_finding());
  put(samples, 4900, 6000);
  const auto finding = analyser_.next_finding();
  ASSERT_TRUE(finding);
  ASSERT_FALSE(finding->explanations.empty());
  EXPECT_EQ(finding->explanations.front().relation, Relation::friction_law);
  const Event event = event_of(*finding);
  EXPECT_EQ(event.code, "model_explained");
  EXPECT_NE(event.message.find("mu is 0.96 instead of 0.8"), std::string::npos) << event.message;
  EXPECT_NE(event.message.find("friction_law"), std::string::npos) << event.message;
  EXPECT_EQ(event.time_ns, alarm().reported_ns);
  EXPECT_FALSE(analyser_.next_finding());
}

TEST_F(AlarmAnalyserTest, AnalysesAPendingAlarmAtTheEnd) {
  const auto samples = samples_of(4.0);
  put(samples, 0, 4000);
  analyser_.request(alarm());
  analyser_.finish();
  const auto finding = analyser_.next_finding();
  ASSERT_TRUE(finding);
  EXPECT_FALSE(finding->explanations.empty());
}

TEST_F(AlarmAnalyserTest, DiscardsFramesWhenTheSourceRestarts) {
  const auto samples = samples_of(2.0);
  put(samples, 0, 2000);
  put(samples, 0, 500);
  analyser_.request(alarm());
  analyser_.finish();
  const auto finding = analyser_.next_finding();
  ASSERT_TRUE(finding);
  EXPECT_TRUE(finding->explanations.empty());
  EXPECT_EQ(event_of(*finding).code, "model_unexplained");
}

TEST(FindingTest, NamesTheClosestAlternative) {
  Finding finding;
  Explanation first;
  first.words = "mu is 1 instead of 0.8";
  first.probability = 0.6;
  first.log_likelihood = 100.0;
  Explanation second;
  second.relation = Relation::normal_load;
  second.words = "the normal load at rest is 0.2 N instead of 0.15 N";
  second.probability = 0.4;
  finding.explanations = {first, second};
  EXPECT_EQ(event_of(finding).message,
            "probable cause of the model mismatch: mu is 1 instead of 0.8 (friction_law, 60 %), "
            "or the normal load at rest is 0.2 N instead of 0.15 N (normal_load, 40 %)");
  finding.explanations[1].probability = 0.01;
  EXPECT_EQ(event_of(finding).message.find("or the"), std::string::npos);
  finding.explanations[0].log_likelihood = 1.0;
  EXPECT_EQ(event_of(finding).code, "model_unexplained");
}

}  // namespace
}  // namespace stickslip::daemon
