// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/diagnosis.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "physics/problem.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::driven_mass;
using test::record;

TEST(Diagnosis, RefusesATooShortRecordingWithAReason) {
  try {
    Options options;
    options.horizon_s = 0.5;
    diagnose({record(driven_mass(), 1.6)}, driven_mass(), options);
    FAIL() << "was not refused";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("bench.csv: is too short"));
  }
}

TEST(Diagnosis, ReportsProgressFromStartToEnd) {
  std::vector<double> done;
  Options options;
  options.threads = 2;
  options.progress = [&](const std::string& what, double share) {
    EXPECT_FALSE(what.empty());
    done.push_back(share);
  };
  diagnose({record(driven_mass(), 12.0)}, driven_mass(), options);
  ASSERT_FALSE(done.empty());
  EXPECT_TRUE(std::is_sorted(done.begin(), done.end()));
  EXPECT_EQ(done.back(), 1.0);
}

}  // namespace
}  // namespace stickslip::diagnosis
