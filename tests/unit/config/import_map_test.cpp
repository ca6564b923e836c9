// SPDX-License-Identifier: Apache-2.0
#include "config/import_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "physics/problem.h"

namespace stickslip::config {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// One file per test: tests run in parallel.
std::filesystem::path file_with(const std::string& text) {
  const std::string test = testing::UnitTest::GetInstance()->current_test_info()->name();
  const auto file = std::filesystem::path(testing::TempDir()) / ("import_map_" + test + ".toml");
  std::ofstream(file) << text;
  return file;
}

std::string refusal(const std::string& text) {
  try {
    load_import_map(file_with(text));
  } catch (const InputError& error) {
    return error.what();
  }
  return "none";
}

TEST(ImportMap, ChannelUnitFactorAndSignByColumn) {
  const auto map = load_import_map(file_with(
      "\"Weg [mm]\" = { channel = \"displacement\", unit = \"mm\", factor = 2, sign = -1 }\n"
      "Kraft = \"drive_force\"\n"));
  ASSERT_EQ(map.size(), 2u);
  EXPECT_EQ(map[0].column, "Kraft");
  EXPECT_EQ(map[0].channel, "drive_force");
  EXPECT_EQ(map[1].unit, "mm");
  EXPECT_EQ(map[1].factor, -2.0);
}

TEST(ImportMap, RefusesWhatItDoesNotKnow) {
  EXPECT_THAT(refusal("x = { unti = \"mm\" }\n"), AllOf(HasSubstr(":1"), HasSubstr("unti")));
  EXPECT_THAT(refusal("\nx = { sign = 2 }\n"), AllOf(HasSubstr(":2"), HasSubstr("1 or -1")));
  EXPECT_THAT(refusal("x = 3\n"), HasSubstr("expected a channel"));
  EXPECT_THAT(refusal("x = = 3\n"), HasSubstr("not valid TOML"));
}

}  // namespace
}  // namespace stickslip::config
