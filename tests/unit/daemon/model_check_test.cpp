#include "daemon/model_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "physics/simulator.h"

namespace stickslip::daemon {
namespace {

using diagnosis::LiveStatus;
using ::testing::HasSubstr;

// 1 kg on a spring, 200 frames/s.
physics::Model driven_mass() {
  physics::Model model;
  model.oscillator.excitation = physics::Excitation::force;
  model.oscillator.mass_kg = {1.0};
  model.oscillator.stiffness_n_m = physics::Parameter{158.0, 5.0};
  model.oscillator.damping_n_s_m = physics::Parameter{0.5, 0.2};
  model.sensors[index_of(Channel::displacement)].noise_std = 2.0e-5;
  return model;
}

physics::Model sliding_mass() {
  physics::Model model = driven_mass();
  model.terms.push_back({"dry_friction", {}, {{"friction_force_n", {0.5}}}});
  return model;
}

std::vector<Sample> samples_of(const physics::Model& model, double duration_s) {
  physics::SimulationOptions options;
  options.step_s = 5.0e-4;
  physics::RigSimulator rig(model, options);
  std::vector<Sample> out;
  for (int k = 0; k < static_cast<int>(duration_s * 200.0); ++k) {
    for (int part = 1; k > 0 && part <= 10; ++part) {
      physics::Input input;
      input.drive_force_n = 1.5 * std::sin(12.0 * ((k - 1) * 5.0e-3 + part * 5.0e-4));
      rig.advance(5.0e-4, input);
    }
    Sample sample;
    sample.frame = rig.read();
    sample.frame.time_ns = std::int64_t{5'000'000} * k;
    out.push_back(sample);
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
