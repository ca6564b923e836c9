// SPDX-License-Identifier: Apache-2.0
#include "config/shipped_files.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tools/files/temporary_folder.h"

namespace stickslip::config {
namespace {

namespace fs = std::filesystem;

class ShippedFiles : public testing::Test {
 protected:
  ShippedFiles() {
    fs::create_directories(shipped_ / "models");
    for (const char* name : {"simulated.toml", "models/simulated.toml", "models/beam-1.toml"}) {
      std::ofstream(shipped_ / name) << "schema = 1\n";
    }
  }

  files::TemporaryFolder folder_;
  fs::path shipped_ = folder_.path();
};

TEST_F(ShippedFiles, AreFoundByNameInTheFolderOfTheirKind) {
  EXPECT_EQ(file_meant("simulated", "models", shipped_), shipped_ / "models/simulated.toml");
  EXPECT_EQ(file_meant("simulated", "", shipped_), shipped_ / "simulated.toml");
  EXPECT_EQ(file_meant("beam-1.toml", "", shipped_), shipped_ / "models/beam-1.toml");
  EXPECT_EQ(file_meant("config/models/beam-1.toml", "models", shipped_),
            shipped_ / "models/beam-1.toml");
  EXPECT_EQ(file_meant("models/beam-1", "models", shipped_), shipped_ / "models/beam-1.toml");
}

TEST_F(ShippedFiles, YieldToAFileOfThatPath) {
  const fs::path own = shipped_ / "models/beam-1.toml";
  EXPECT_EQ(file_meant(own.string(), "", shipped_), own);
  EXPECT_EQ(file_meant("/nowhere/beam-1.toml", "models", shipped_), "/nowhere/beam-1.toml");
}

TEST_F(ShippedFiles, LeaveAnUnknownNameAsItIs) {
  EXPECT_EQ(file_meant("beam-9", "models", shipped_), "beam-9");
  EXPECT_EQ(file_meant("beam-1", "models", fs::path()), "beam-1");
  EXPECT_EQ(file_meant("", "", shipped_), "");
}

}  // namespace
}  // namespace stickslip::config
