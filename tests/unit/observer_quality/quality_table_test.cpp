// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/quality_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace stickslip::quality {
namespace {

using ::testing::HasSubstr;

RecordingQuality recording(const char* world, double force_error) {
  RecordingQuality out;
  out.name = "null 1";
  out.world = world;
  out.duration_s = 1800.0;
  out.by_hand.best.force = 0.1;
  out.filter.force = force_error;
  out.filter.mu_coverage = 0.5 * force_error;
  out.filter.final_mu_covered = force_error < 0.1;
  out.filter.restarts = force_error > 0.1 ? 3 : 1;
  out.smoother.largest_theta = force_error > 0.1 ? 2.0 : 1.0;
  out.alarms = force_error > 0.1 ? 2 : 0;
  return out;
}

TEST(QualityTables, CountEveryRecording) {
  RecordingQuality refused = recording("imposed", 0.0);
  refused.unsupported = "no force balance";
  const std::string text =
      quality_tables({recording("skewed", 0.04), recording("skewed", 0.2), refused,
                      recording("regular", std::numeric_limits<double>::infinity())});
  // recordings, with friction, by hand (causal, best), filter
  EXPECT_THAT(text, HasSubstr("| skewed | 2 | 2 | - | 10 (10) | 12 (20) | - |\n"));
  EXPECT_THAT(text, HasSubstr("| regular | 1 | 1 | - | 10 (10) | infinite (infinite) | - |\n"));
  EXPECT_THAT(text, HasSubstr("| all | 3 | 3 | - | 10 (10) | 20 (infinite) | - |\n"));
  EXPECT_THAT(text, HasSubstr("| not supported, of 4 recordings | reason |"));
  EXPECT_THAT(text, HasSubstr("| 1 | no force balance |\n"));
  EXPECT_THAT(text, HasSubstr("| 1 of 2 |"));
  // restarts, recordings with an unphysical theta, false alarms, hours
  EXPECT_THAT(text, HasSubstr("| 4 (3) | 1 | 2 (2) | 1.00 |\n"));
  EXPECT_THAT(text, HasSubstr("| 7 (3) | 2 | 4 (2) | 1.50 |\n"));
}

TEST(LiveCheckTable, ComparesExplanations) {
  std::vector<RecordingQuality> all(4, recording("force", 0.0));
  const Explained right{.certain = true, .right = true, .probability = 0.99, .effect = "clipping"};
  Explained wrong = right;
  wrong.right = false;
  const Explained uncertain{
      .certain = false, .right = true, .probability = 0.6, .effect = "clipping"};
  all[0].notice = Notice{.after_s = 1.5, .at_once = uncertain, .at_last = right};
  all[1].notice = Notice{.after_s = 8.0, .at_once = wrong, .at_last = wrong};
  all[2].notice = Notice{.after_s = 20.0, .at_once = right, .at_last = right};
  // recordings; within 2 s, ever; at once and at last: certain (right, wrong), uncertain (right,
  // wrong)
  EXPECT_THAT(live_check_table(all),
              HasSubstr("| force | 4 | 1 | 3 | 1 | 1 | 1 | 0 | 2 | 1 | 0 | 0 |\n"));
}

TEST(FalseAlarmTable, SumsAlarmsAndHours) {
  const std::string text = false_alarm_table({recording("force", 0.2), recording("skewed", 0.0)});
  EXPECT_THAT(text, HasSubstr("| force | 1 | 2 (2) | 0.50 |\n"));
  EXPECT_THAT(text, HasSubstr("| all | 2 | 2 (2) | 1.00 |\n"));
}

TEST(Renewed, ReplacesTheLinesBetweenTheMarksOfItsKind) {
  const std::string before =
      "a\n<!-- observer_table --kind null -->\n\nold\n<!-- end -->\nb\n"
      "<!-- observer_table --kind single -->\n<!-- end -->\n";
  const std::string once = renewed(before, "null", "new\n");
  EXPECT_EQ(once,
            "a\n<!-- observer_table --kind null -->\n\nnew\n<!-- end -->\nb\n"
            "<!-- observer_table --kind single -->\n<!-- end -->\n");
  EXPECT_EQ(renewed(once, "null", "new\n"), once);
  EXPECT_THAT(renewed(before, "single", "new\n"), HasSubstr("single -->\n\nnew\n<!-- end"));
  EXPECT_THROW(renewed("no marks", "null", ""), std::invalid_argument);
  EXPECT_THROW(renewed("<!-- observer_table --kind null -->\n", "null", ""), std::invalid_argument);
}

TEST(Rows, OnePerRecording) {
  const std::string text = rows_of({recording("skewed", 0.04), recording("force", 0.2)});
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 3);
  EXPECT_THAT(text, HasSubstr("null 1,skewed,,1800,,0.1,,,0.04,"));
}

}  // namespace
}  // namespace stickslip::quality
