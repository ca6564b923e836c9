// SPDX-License-Identifier: Apache-2.0
// The progress line under simulated time and width.
#include "tools/terminal/progress_line.h"

#include <gtest/gtest.h>

#include "tools/terminal/text.h"

namespace {

using namespace stickslip::terminal;

constexpr const char* erase_line = "\r\033[K";

std::string drawn(const std::string& text) { return erase_line + text; }

TEST(DurationText, RoundsUpAndUsesTwoUnitsAtMost) {
  EXPECT_EQ(duration_text(0.0), "0 s");
  EXPECT_EQ(duration_text(0.2), "1 s");
  EXPECT_EQ(duration_text(59.5), "1 min");
  EXPECT_EQ(duration_text(200.0), "3 min 20 s");
  EXPECT_EQ(duration_text(3600.0 * 2 + 300.0), "2 h 5 min");
  EXPECT_EQ(duration_text(86400.0 * 4 + 3600.0 * 7), "4 d 7 h");
  EXPECT_EQ(duration_text(1e300), "very long");
}

TEST(ProgressText, ExtrapolatesTheTimeLeft) {
  EXPECT_EQ(progress_text({"fitting", 0.25}, 10.0, 80), " 25 %  fitting, 30 s left");
  EXPECT_EQ(progress_text({"fitting", 0.999}, 999.0, 80), " 99 %  fitting, 1 s left");
}

TEST(ProgressText, DoesNotExtrapolateFromZero) {
  EXPECT_EQ(progress_text({"fitting", 0.0}, 5.0, 80), "  0 %  fitting");
}

TEST(ProgressText, ShowsTheElapsedTimeIfTheTotalIsUnknown) {
  EXPECT_EQ(progress_text({"recording", {}}, 75.9, 80), "recording, 1 min 15 s");
}

TEST(ProgressText, StaysWithinAnyWidth) {
  for (const std::optional<double> done :
       {std::optional<double>{}, std::optional<double>{0.0}, std::optional<double>{0.07}}) {
    for (std::size_t columns = 0; columns < 120; ++columns) {
      const std::string text =
          progress_text({"reading a recording with a long name", done}, 4000.0, columns);
      EXPECT_TRUE(text.empty() || columns_in(text) < columns) << columns << ": " << text;
    }
  }
}

TEST(ProgressText, ShortensTheLabelFirst) {
  const Status status{"reading a recording", 0.25};
  EXPECT_EQ(progress_text(status, 10.0, 36), " 25 %  reading a reco..., 30 s left");
  EXPECT_EQ(progress_text(status, 10.0, 20), "25 %, 30 s left");
  EXPECT_EQ(progress_text(status, 10.0, 10), "25 %");
  EXPECT_EQ(progress_text(status, 10.0, 4), "");
}

TEST(ProgressText, ClampsTheShare) {
  EXPECT_EQ(progress_text({"x", 1.7}, 3.0, 80), "100 %  x, 0 s left");
  EXPECT_EQ(progress_text({"x", -3.0}, 3.0, 80), "  0 %  x");
}

TEST(ProgressLine, IsEmptyInTheFirstSecond) {
  ProgressLine line(100.0);
  EXPECT_EQ(line.draw(100.0, {"x", 0.5}, 80), "");
  EXPECT_EQ(line.draw(100.99, {"x", 0.9}, 80), "");
  EXPECT_EQ(line.erase(), "");  // never drawn
}

TEST(ProgressLine, AppearsIsRedrawnAndErased) {
  ProgressLine line(100.0);
  EXPECT_EQ(line.draw(101.0, {"x", 0.5}, 80), drawn(" 50 %  x, 1 s left"));
  EXPECT_EQ(line.draw(104.0, {"x", 0.8}, 80), drawn(" 80 %  x, 1 s left"));
  EXPECT_EQ(line.erase(), erase_line);
  EXPECT_EQ(line.erase(), "");
}

TEST(ProgressLine, IsDrawnTenTimesASecondAtMost) {
  ProgressLine line(0.0);
  int count = 0;
  for (int i = 0; i < 4000; ++i) {
    const double now_s = 2.0 + 0.001 * i;
    if (!line.draw(now_s, {std::to_string(i), i / 4000.0}, 80).empty()) ++count;
  }
  EXPECT_GT(count, 30);
  EXPECT_LE(count, 40);
}

TEST(ProgressLine, IsNotRedrawnUnchanged) {
  ProgressLine line(0.0);
  EXPECT_NE(line.draw(2.0, {"x", {}}, 80), "");
  EXPECT_EQ(line.draw(2.5, {"x", {}}, 80), "");
  EXPECT_NE(line.draw(3.0, {"x", {}}, 80), "");
}

TEST(ProgressLine, IsErasedIfTheTerminalBecomesTooNarrow) {
  ProgressLine line(0.0);
  EXPECT_EQ(line.draw(2.0, {"x", 0.5}, 80), drawn(" 50 %  x, 2 s left"));
  EXPECT_EQ(line.draw(3.0, {"x", 0.5}, 3), erase_line);
  EXPECT_EQ(line.draw(4.0, {"x", 0.5}, 3), "");
}

TEST(ProgressLine, ContainsNoForeignControlSequences) {
  ProgressLine line(0.0);
  EXPECT_EQ(line.draw(2.0, {"reading \033[2J", 0.5}, 80), drawn(" 50 %  reading  [2J, 2 s left"));
}

}  // namespace
