// SPDX-License-Identifier: Apache-2.0
// Golden messages: tests/data/malformed_recordings/NAME.csv is refused with the line in NAME.error.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "physics/problem.h"
#include "protocol/recording.h"
#include "tests/unit/protocol/files.h"

namespace stickslip::protocol {
namespace {

const std::filesystem::path folder = STICKSLIP_TEST_DATA "/malformed_recordings";

std::vector<std::string> cases() {
  std::vector<std::string> out;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".csv") out.push_back(entry.path().stem());
  }
  std::sort(out.begin(), out.end());
  return out;
}

class Malformed : public testing::TestWithParam<std::string> {};

TEST_P(Malformed, IsRefusedWithTheExpectedMessage) {
  const std::string name = GetParam();
  std::string message = "accepted";
  try {
    parse_csv(content(folder / (name + ".csv")), name + ".csv");
  } catch (const InputError& error) {
    message = error.what();
  }
  EXPECT_EQ(message + "\n", content(folder / (name + ".error")));
}

INSTANTIATE_TEST_SUITE_P(Csv, Malformed, testing::ValuesIn(cases()),
                         [](const auto& tested) { return tested.param; });

TEST(MalformedRecordings, Exist) { EXPECT_GE(cases().size(), 15U); }

}  // namespace
}  // namespace stickslip::protocol
