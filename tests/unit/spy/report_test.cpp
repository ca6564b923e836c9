// SPDX-License-Identifier: Apache-2.0
// Statistics of the traffic as text and as JSON.
#include "tools/spy/report.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "messages.h"
#include "protocol/channels.h"
#include "tools/terminal/text.h"

namespace stickslip::spy {
namespace {

constexpr std::int64_t now_us = 1'000'000;

Traffic some_traffic() {
  Traffic traffic;
  for (std::uint64_t i = 0; i < 10; ++i) {
    traffic.add(protocol::frames_channel, block_of({i + 1}), static_cast<std::int64_t>(i) * 10'000);
  }
  traffic.add(protocol::frames_channel, block_of({20}), 500'000);
  traffic.add("CAMERA_LEFT", std::vector<std::uint8_t>(2000, 0xAB), 900'000);
  traffic.close_interval(1.0);
  return traffic;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> out;
  for (std::string line; std::getline(in, line);) out.push_back(line);
  return out;
}

std::vector<std::string> names(const View& view, const Traffic& traffic) {
  std::vector<std::string> out;
  for (const ChannelTraffic* each : selected_channels(view, traffic, now_us)) {
    out.push_back(each->channel);
  }
  return out;
}

using Names = std::vector<std::string>;

TEST(View, SortsByTheChosenKey) {
  const Traffic traffic = some_traffic();
  const Names frames_first = {"STICKSLIP_FRAMES", "CAMERA_LEFT"};
  const Names camera_first = {"CAMERA_LEFT", "STICKSLIP_FRAMES"};
  EXPECT_EQ(names({{}, Order::name, false}, traffic), camera_first);
  EXPECT_EQ(names({{}, Order::rate, false}, traffic), frames_first);
  EXPECT_EQ(names({{}, Order::size, false}, traffic), camera_first);
  EXPECT_EQ(names({{}, Order::age, false}, traffic), frames_first);
  EXPECT_EQ(names({{}, Order::lost, false}, traffic), frames_first);
}

TEST(View, SelectsChannelsByName) {
  const Traffic traffic = some_traffic();
  EXPECT_EQ(names({{"left"}, Order::name, false}, traffic), Names{"CAMERA_LEFT"});
  EXPECT_EQ(names({{"left", "frames"}, Order::name, false}, traffic).size(), 2U);
  EXPECT_TRUE(names({{"right"}, Order::name, false}, traffic).empty());
}

TEST(Table, ShowsEveryStatistic) {
  const auto rows =
      lines_of(table({{}, Order::rate, false}, some_traffic(), now_us, 0, terminal::Paint(false)));
  ASSERT_EQ(rows.size(), 6U);  // heading, frames with their losses and values, the camera
  EXPECT_EQ(rows[0],
            "CHANNEL           MESSAGES  RATE/s  JITTER ms  kB/s  SIZE B  AGE s  LOST  BAD  TYPE");
  EXPECT_EQ(rows[1].substr(0, 43), "STICKSLIP_FRAMES        11    11.0      400");
  EXPECT_NE(rows[1].find("  0.5     9    0  frame_block_t"), std::string::npos) << rows[1];
  EXPECT_EQ(rows[2], "  11 frames, lost 9 in 1 gap");
  EXPECT_EQ(rows[3], "  t 0.020 s: displacement 0.02 m");
  EXPECT_NE(rows[4].find("2000    0.1     -    -  unknown"), std::string::npos) << rows[4];
  EXPECT_EQ(rows[5], "  unknown type 0xabababababababab");
}

TEST(Table, KeepsLossesIfNarrow) {
  const View view{{"frames"}, Order::name, false};
  const auto rows = lines_of(table(view, some_traffic(), now_us, 60, terminal::Paint(false)));
  EXPECT_EQ(rows[0], "CHANNEL           MESSAGES  RATE/s  SIZE B  AGE s  LOST  BAD");
  EXPECT_TRUE(rows[1].ends_with("  0.5     9    0")) << rows[1];
}

TEST(Table, ShowsTheRangeOfEveryValue) {
  const std::string text =
      table({{"frames"}, Order::name, true}, some_traffic(), now_us, 0, terminal::Paint(false));
  EXPECT_NE(text.find("displacement               0.02 m      from        0.001 to         0.02"),
            std::string::npos)
      << text;
}

TEST(Table, FitsAnyWidthWithoutCuttingEscapeSequences) {
  const Traffic traffic = some_traffic();
  for (std::size_t columns = 1; columns < 140; ++columns) {
    for (const std::string& row : lines_of(
             table({{}, Order::name, true}, traffic, now_us, columns, terminal::Paint(false)))) {
      EXPECT_LE(terminal::columns_in(row), columns) << row;
    }
    const std::string painted =
        table({{}, Order::name, true}, traffic, now_us, columns, terminal::Paint(true));
    std::size_t open = 0;
    for (std::size_t at = painted.find('\033'); at != std::string::npos;
         at = painted.find('\033', at + 1)) {
      const bool ends = painted.compare(at, 4, "\033[0m") == 0;
      EXPECT_EQ(open, ends ? 1U : 0U) << columns;
      open = ends ? 0 : 1;
    }
    EXPECT_EQ(open, 0U) << columns;
  }
}

TEST(Table, HighlightsLosses) {
  const std::string text =
      table({{}, Order::name, false}, some_traffic(), now_us, 0, terminal::Paint(true));
  EXPECT_NE(text.find("\033[1;31m   9\033[0m"), std::string::npos) << text;
}

TEST(Lines, AreSelfContained) {
  const auto rows = lines_of(lines({{"frames"}, Order::name, false}, some_traffic(), now_us));
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_NE(rows[0].find("11 messages, 11.0/s"), std::string::npos) << rows[0];
  EXPECT_NE(rows[0].find("frame_block_t, 0.5 s ago, 11 frames, lost 9 in 1 gap | t 0.020 s"),
            std::string::npos)
      << rows[0];
}

TEST(Lines, EscapeControlCharactersInNames) {
  Traffic traffic;
  traffic.add("EVIL\033[2J\nNAME", std::vector<std::uint8_t>{}, 0);
  const std::string text = lines({}, traffic, now_us);
  EXPECT_EQ(text.find('\033'), std::string::npos);
  EXPECT_EQ(lines_of(text).size(), 1U);
  const std::string drawn = table({}, traffic, now_us, 0, terminal::Paint(false));
  EXPECT_EQ(drawn.find('\033'), std::string::npos);
}

TEST(Json, HasTheSameStatistics) {
  const auto report =
      nlohmann::json::parse(json({{}, Order::rate, false}, some_traffic(), now_us, 3.0));
  EXPECT_EQ(report["schema"], 1);
  const auto& frames = report["channels"][0];
  EXPECT_EQ(frames["channel"], "STICKSLIP_FRAMES");
  EXPECT_EQ(frames["messages"], 11);
  EXPECT_EQ(frames["frames"]["lost"], 9);
  EXPECT_DOUBLE_EQ(frames["values"]["displacement"]["least"], 0.001);
  EXPECT_EQ(frames["values"]["displacement"]["unit"], "m");
  EXPECT_TRUE(report["channels"][1]["type"].is_null());
  EXPECT_EQ(report["channels"][1]["fingerprint"], "0xabababababababab");
}

TEST(Json, IsValidForAnyName) {
  Traffic traffic;
  traffic.add("\xFF\n", std::vector<std::uint8_t>{}, 0);
  EXPECT_FALSE(
      nlohmann::json::parse(json({}, traffic, now_us, 1.0), nullptr, false).is_discarded());
}

}  // namespace
}  // namespace stickslip::spy
