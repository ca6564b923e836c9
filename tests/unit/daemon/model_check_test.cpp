// SPDX-License-Identifier: Apache-2.0
#include "daemon/model_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <vector>

#include "tests/unit/diagnosis/bench.h"

namespace stickslip::daemon {
namespace {

using diagnosis::LiveStatus;
using diagnosis::test::driven_mass;
using diagnosis::test::record;
using diagnosis::test::with_term;
using ::testing::HasSubstr;

physics::Model sliding_mass() {
  return with_term(driven_mass(), "dry_friction", {{"friction_force_n", {0.5}}});
}

std::vector<Sample> samples_of(const physics::Model& model, double duration_s) {
  std::vector<Sample> out;
  const auto force = [](double time_s) { return 1.5 * std::sin(12.0 * time_s); };
  for (const Frame& frame : record(model, duration_s, 1, true, force).frames) {
    out.emplace_back().frame = frame;
  }
  return out;
}

std::vector<Event> events_of(ModelCheck& check) {
  std::vector<Event> out;
  while (const auto event = check.next_event()) out.push_back(*event);
  return out;
}

// All frames at once, as of a replay that is not paced: the last ones are checked at the end.
TEST(ModelCheck, ChecksTheLastFramesOfAFastSource) {
  ModelCheck check(driven_mass(), 30.0);
  check.write_block(samples_of(sliding_mass(), 6.0));
  check.finish();
  EXPECT_EQ(check.verdict().status, LiveStatus::broken);
  const std::vector<Event> events = events_of(check);
  ASSERT_GE(events.size(), 2U);
  EXPECT_EQ(events.front().code, "model_broken");
  EXPECT_THAT(events.front().message, HasSubstr("diagnose the recording from 0.0 s to 1"));
  EXPECT_EQ(events[1].code, "model_explained") << events[1].message;
  EXPECT_THAT(events[1].message, HasSubstr("friction")) << events[1].message;
}

// An explanation takes seconds, on a busy machine minutes: the end of the daemon does not wait.
TEST(ModelCheck, EndsWithoutAnExplanationWhenItsPatienceIsOver) {
  ModelCheck check(driven_mass(), 30.0, std::chrono::seconds(0));
  check.write_block(samples_of(sliding_mass(), 6.0));
  check.finish();
  for (const Event& event : events_of(check)) {
    EXPECT_NE(event.code, "model_explained") << event.message;
    EXPECT_NE(event.code, "model_check_failed") << event.message;
  }
}

TEST(ModelCheck, HasNothingToReportOfASoundRig) {
  ModelCheck check(driven_mass(), 30.0);
  check.write_block(samples_of(driven_mass(), 6.0));
  check.finish();
  EXPECT_EQ(check.verdict().status, LiveStatus::follows);
  EXPECT_TRUE(events_of(check).empty());
}

TEST(ModelCheck, StartsAgainWithTheSource) {
  ModelCheck check(driven_mass(), 30.0);
  check.write_block(samples_of(driven_mass(), 6.0));
  check.write_block(samples_of(driven_mass(), 0.5));
  check.finish();
  EXPECT_TRUE(events_of(check).empty());
}

TEST(ModelCheck, EventsNameStretchAndCertainty) {
  LiveVerdict verdict;
  verdict.status = LiveStatus::broken;
  verdict.chi2 = 4.0;
  verdict.limit = 1.4;
  verdict.since_ns = 65'000'000'000;
  const Event broken = status_event(verdict, 66'500'000'000, 10'000'000);
  EXPECT_EQ(broken.code, "model_broken");
  EXPECT_EQ(broken.severity, Severity::warning);
  EXPECT_EQ(
      broken.message,
      "the rig does not follow its model: residuals have 4 times the power of the noise, since "
      "00:00:08 UTC; diagnose the recording from 45.0 s to 75.0 s of its time_ns");
  EXPECT_EQ(explanation_event(verdict, 0).code, "model_unexplained");
  diagnosis::Explanation found;
  found.statement = "The contact is compliant.";
  found.chi2 = 1.0;
  found.probability = 0.99;
  verdict.explanations = {found};
  EXPECT_EQ(explanation_event(verdict, 0).code, "model_unexplained");
  verdict.is_certain = true;
  EXPECT_EQ(explanation_event(verdict, 0).code, "model_explained");
  verdict.status = LiveStatus::follows;
  EXPECT_EQ(status_event(verdict, 0, 0).message, "the rig follows its model again");
}

}  // namespace
}  // namespace stickslip::daemon
