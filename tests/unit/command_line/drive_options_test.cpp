// SPDX-License-Identifier: Apache-2.0
// The periodic drive given by command-line options.
#include "tools/command_line/drive_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "config/model_file.h"
#include "physics/problem.h"
#include "tools/command_line/program.h"

namespace stickslip::command_line {
namespace {

using testing::HasSubstr;
using Swept = DriveOptions::Swept;

const physics::Model& base_excited_model() {
  static const physics::Model model =
      config::load_model(STICKSLIP_SOURCE_DIR "/config/models/motivational.toml");
  return model;
}

DriveOptions parsed(const std::string& arguments) {
  Program app;
  const auto options = std::make_shared<DriveOptions>();
  add_drive_options(app, options);
  app.parse("--model model.toml " + arguments, false);
  return *options;
}

std::string error(const DriveOptions& options, Swept swept = Swept::nothing) {
  try {
    options.drive(base_excited_model(), 100, swept);
  } catch (const InputError& problem) {
    return problem.what();
  }
  return "";
}

TEST(DriveOptions, ConvertBaseAmplitudeToAcceleration) {
  ASSERT_EQ(base_excited_model().oscillator.excitation, physics::Excitation::base);
  const dynamics::Drive drive =
      parsed("--frequency-hz 4.2 --amplitude 0.008").drive(base_excited_model(), 100);
  const double omega = 2.0 * std::numbers::pi * 4.2;
  EXPECT_DOUBLE_EQ(drive.omega_rad_s, omega);
  EXPECT_DOUBLE_EQ(drive.acceleration_m_s2, 0.008 * omega * omega);
}

TEST(DriveOptions, DivideAForceByTheMass) {
  physics::Model model = base_excited_model();
  model.oscillator.excitation = physics::Excitation::force;
  const dynamics::Drive drive = parsed("--omega 10 --amplitude 2").drive(model, 100);
  EXPECT_DOUBLE_EQ(drive.omega_rad_s, 10.0);
  EXPECT_DOUBLE_EQ(drive.acceleration_m_s2, 2.0 / model.oscillator.mass_kg.value);
}

TEST(DriveOptions, AcceptAnAcceleration) {
  const dynamics::Drive drive =
      parsed("--omega 10 --acceleration 1.9").drive(base_excited_model(), 100);
  EXPECT_DOUBLE_EQ(drive.acceleration_m_s2, 1.9);
}

TEST(DriveOptions, RequireFrequencyAndStrengthOnce) {
  EXPECT_THAT(error(parsed("--amplitude 1")), HasSubstr("the drive's frequency"));
  EXPECT_THAT(error(parsed("--omega 1")), HasSubstr("the drive's strength"));
  EXPECT_THAT(error(parsed("--omega 1 --frequency-hz 1 --amplitude 1")),
              HasSubstr("both are given"));
  EXPECT_THAT(error(parsed("--omega 1 --amplitude 1 --acceleration 1")),
              HasSubstr("both are given"));
}

TEST(DriveOptions, DoNotRequireTheSweptQuantity) {
  EXPECT_EQ(error(parsed("--amplitude 0.01"), Swept::frequency), "");
  EXPECT_EQ(error(parsed("--omega 20"), Swept::strength), "");
}

TEST(DriveOptions, RefuseImposedMotion) {
  physics::Model model = base_excited_model();
  model.oscillator.excitation = physics::Excitation::imposed;
  EXPECT_THROW(parsed("--omega 1 --amplitude 1").drive(model, 100), InputError);
}

TEST(DriveOptions, SetTheInitialStateAndSteps) {
  const dynamics::PortraitOptions options =
      parsed("--x 0.5 --v -0.1 --transient 7 --steps 64").portrait();
  EXPECT_EQ(options.x_m, 0.5);
  EXPECT_EQ(options.v_m_s, -0.1);
  EXPECT_EQ(options.transient, 7);
  EXPECT_EQ(options.steps_per_period, 64);
}

TEST(DriveOptions, CheckTheirRanges) {
  for (const char* arguments :
       {"--steps 15", "--steps 16.5", "--transient -1", "--omega 0", "--amplitude -1", "--x nan"}) {
    EXPECT_THROW(parsed(arguments), CLI::ParseError) << arguments;
  }
  EXPECT_EQ(parsed("--steps 0").steps, 0);
}

}  // namespace
}  // namespace stickslip::command_line
