// SPDX-License-Identifier: Apache-2.0
#include "daemon/model_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "physics/simulator.h"
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

/// A rig that goes on for as long as the checks of a busy machine take.
class EndlessRig {
 public:
  explicit EndlessRig(const physics::Model& model) : rig_(model, {.step_s = 5.0e-4, .seed = 1}) {}

  std::vector<Sample> next(int count) {
    std::vector<Sample> out;
    for (int i = 0; i < count; ++i) {
      for (int part = 1; part <= parts; ++part) {
        physics::Input input;
        const double share = static_cast<double>(part) / parts;
        input.drive_force_n = 1.5 * std::sin(12.0 * (static_cast<double>(frames_) + share) /
                                             diagnosis::test::rate_hz);
        rig_.advance(1.0 / (parts * diagnosis::test::rate_hz), input);
      }
      Frame frame = rig_.read();
      frame.time_ns = ++frames_ * static_cast<std::int64_t>(1.0e9 / diagnosis::test::rate_hz);
      frame.valid &= diagnosis::test::bits_of_displacement_and_force;
      out.emplace_back().frame = frame;
    }
    return out;
  }

 private:
  static constexpr int parts = 10;
  physics::RigSimulator rig_;
  std::int64_t frames_ = 0;
};

/// Passes samples on until an event of that code; the event, if any.
std::optional<Event> event_after(ModelCheck& check, EndlessRig& rig, const std::string& code) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::minutes(5);
  while (std::chrono::steady_clock::now() < until) {
    check.write_block(rig.next(100));
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    while (const auto event = check.next_event()) {
      if (event->code == code) return event;
    }
  }
  return std::nullopt;
}

// The explanation that has just begun ends without a result.
TEST(ModelCheck, AMendedModelIsFollowedFromItsChangeOn) {
  ModelCheck check(driven_mass(), 30.0);
  EndlessRig rig(sliding_mass());
  ASSERT_TRUE(event_after(check, rig, "model_broken"));
  check.change_model(sliding_mass());
  EXPECT_EQ(check.verdict().status, LiveStatus::waiting);
  const std::optional<Event> event = event_after(check, rig, "model_follows");
  ASSERT_TRUE(event);
  EXPECT_EQ(event->message, "the rig follows its new model");
  check.finish();
  EXPECT_EQ(check.verdict().status, LiveStatus::follows);
  EXPECT_EQ(check.verdict().alarms, 1U);
  EXPECT_TRUE(events_of(check).empty());
}

TEST(ModelCheck, AModelThatIsNotThatOfTheRigIsReportedAndItsAlarmsAreCountedOn) {
  ModelCheck check(sliding_mass(), 30.0, std::chrono::seconds(0));
  EndlessRig rig(sliding_mass());
  check.change_model(driven_mass());
  ASSERT_TRUE(event_after(check, rig, "model_broken"));
  check.change_model(sliding_mass());
  check.change_model(driven_mass());
  ASSERT_TRUE(event_after(check, rig, "model_broken"));
  check.finish();
  EXPECT_EQ(check.verdict().alarms, 2U);
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
