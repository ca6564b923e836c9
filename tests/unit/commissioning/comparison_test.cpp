// SPDX-License-Identifier: Apache-2.0
#include "tools/commissioning/comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/commissioning/commissioning.h"

namespace stickslip::commissioning {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

config::Rig bench() { return config::load_rig(STICKSLIP_SOURCE_DIR "/config/bench-u6.toml"); }

Record accepted(const config::Rig& rig) {
  Record out;
  out.settings = bench_settings(rig);
  for (const Step& step : all_steps()) {
    out.put({step.id, Verdict::passed, "2026-03-02T10:00:00Z", "", "", {}});
  }
  return out;
}

TEST(Comparison, HasNoReservationsAboutAnAcceptedBench) {
  EXPECT_THAT(reservations(accepted(bench()), bench()), IsEmpty());
}

TEST(Comparison, NamesSettingsThatAreOthersNow) {
  Record record = accepted(bench());
  for (auto& [key, value] : record.settings) {
    if (key == "inputs.displacement.from") value = "\"labjack_u6/AIN5\"";
  }
  EXPECT_THAT(reservations(record, bench()),
              ElementsAre(testing::AllOf(HasSubstr("inputs.displacement.from"), HasSubstr("AIN0"),
                                         HasSubstr("AIN5"))));
}

TEST(Comparison, AllowsForACalibrationButNotForAnotherDirection) {
  const Record record = accepted(bench());
  config::Rig calibrated = bench();
  calibrated.calibration[index_of(Channel::velocity)].gain *= 1.07;
  EXPECT_THAT(reservations(record, calibrated), IsEmpty());
  calibrated.calibration[index_of(Channel::velocity)].gain *= -1.0;
  EXPECT_THAT(reservations(record, calibrated),
              ElementsAre(HasSubstr("calibration.velocity.gain is negative and was positive")));
}

TEST(Comparison, NamesStepsThatAreMissing) {
  Record record = accepted(bench());
  record.put({"drive", Verdict::failed, "", "", "", {}});
  record.put({"shunt", Verdict::not_applicable, "", "", "", {}});
  std::erase_if(record.steps, [](const StepRecord& each) { return each.step == "polarity"; });
  EXPECT_THAT(
      reservations(record, bench()),
      ElementsAre("steps that failed: drive", HasSubstr("steps that are not done: polarity; ")));
}

TEST(Comparison, FindsZerosThatMovedAndNoiseThatGrew) {
  Record record;
  record.put({"noise",
              Verdict::passed,
              "",
              "",
              "",
              {{"velocity.zero_raw", 0.1, 1e-4, "V"}, {"velocity.noise_raw", 1e-3, {}, "V"}}});
  EXPECT_THAT(drifts(record, {Channel::velocity, 0.1, 1e-3, 1000}), IsEmpty());
  EXPECT_THAT(drifts(record, {Channel::velocity, 0.103, 2e-3, 1000}), IsEmpty());
  EXPECT_THAT(drifts(record, {Channel::velocity, 0.12, 1e-3, 1000}),
              ElementsAre(HasSubstr("the zero of velocity is 0.12 V and was 0.1")));
  EXPECT_THAT(drifts(record, {Channel::velocity, 0.1, 4e-3, 1000}),
              ElementsAre(HasSubstr("the noise of velocity is 0.004 V and was 0.001")));
  EXPECT_THAT(drifts(record, {Channel::displacement, 5.0, 1.0, 1000}), IsEmpty());
}

}  // namespace
}  // namespace stickslip::commissioning
