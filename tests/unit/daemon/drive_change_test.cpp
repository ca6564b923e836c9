// SPDX-License-Identifier: Apache-2.0
#include "daemon/drive_change.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "physics/problem.h"

namespace stickslip::daemon {
namespace {

class DriveChangeTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "stickslip-drive-XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    const std::filesystem::path file = folder_ / "drive.csv";
    std::ofstream(file) << "time_s,base_displacement_m\n0,0\n1,0.001\n2,0.002\n3,0.001\n4,0\n";
    rig_.excitation.enabled = true;
    rig_.excitation.kind = config::ExcitationKind::file;
    rig_.excitation.file.path = file;
    rig_.model.oscillator.excitation = physics::Excitation::base;
    rig_.loop.rate_hz = 1000.0;
  }
  void TearDown() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  static Answer accepted() {
    Answer out;
    out.accepted = true;
    return out;
  }

  std::filesystem::path folder_;
  config::Rig rig_;
  DriveChange change_;
};

TEST_F(DriveChangeTest, TheConfiguredDriveReturnsWithoutItsFile) {
  const DriveSamples samples{0.1, {0.0, 1.0e-4, 2.0e-4, 1.0e-4, 0.0}};
  EXPECT_NE(change_.propose(rig_, samples).excitation, nullptr);
  // As the loop does: the configured drive is exchanged for the samples.
  EXPECT_EQ(change_.finish(accepted())->kind, config::ExcitationKind::file);
  std::filesystem::remove(folder_ / "drive.csv");

  EXPECT_NE(change_.propose(rig_, {}).excitation, nullptr);
  EXPECT_FALSE(change_.finish({})) << "refused by the loop";
  EXPECT_NE(change_.propose(rig_, {}).excitation, nullptr) << "asked again";
  EXPECT_EQ(change_.finish(accepted())->file.path, folder_ / "drive.csv");
}

TEST_F(DriveChangeTest, RefusesSamplesThatDoNotEndAtRest) {
  EXPECT_THROW(change_.propose(rig_, {0.1, {0.0, 1.0e-4, 2.0e-4, 1.0e-4}}), InputError);
  EXPECT_THROW(change_.propose(rig_, {0.0, {0.0, 1.0e-4, 2.0e-4, 1.0e-4, 0.0}}), InputError);
}

}  // namespace
}  // namespace stickslip::daemon
