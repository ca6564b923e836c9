// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/recording_index.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <stickslip/event_t.hpp>
#include <stickslip/friction_estimate_t.hpp>

#include "messages.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/frame_block.h"
#include "protocol/recording.h"
#include "protocol/recording_log.h"

namespace stickslip::scope {
namespace {

using nlohmann::json;
using test::frames_from;

template <class Type>
std::vector<std::uint8_t> encoded(const Type& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

event_t note_at(std::int64_t time_ns, const std::string& text) {
  event_t out{};
  out.time_ns = time_ns;
  out.code = "note";
  out.message = text;
  return out;
}

/// The messages of a piece: blocks of frames, and JSON.
struct Read {
  std::vector<test::ReadBlock> blocks;
  std::vector<json> texts;
};

Read read_piece(const std::string& bytes) {
  Read out;
  const std::span all(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  for (std::size_t at = 0; at < all.size();) {
    const auto size = test::read_at<std::uint32_t>(all, at);
    const bool is_binary = test::read_at<std::uint32_t>(all, at + 4) == 1;
    const auto content = all.subspan(at + 8, size);
    at += 8 + size;
    if (is_binary) {
      Message message(content.size());
      std::copy(content.begin(), content.end(), message.payload().begin());
      out.blocks.push_back(test::read_block(message));
    } else {
      out.texts.push_back(json::parse(content.begin(), content.end()));
    }
  }
  return out;
}

class RecordingIndexTest : public testing::Test {
 protected:
  ~RecordingIndexTest() override { std::filesystem::remove(file); }

  template <class Type>
  void append(const char* channel, const Type& message, std::int64_t time_us) {
    ASSERT_TRUE(log->append(channel, encoded(message), time_us));
  }
  void append_frames(std::uint64_t first, std::size_t count, std::size_t per = 10) {
    std::vector<std::uint8_t> bytes;
    for (std::size_t i = 0; i < count; i += per) {
      protocol::encode_block(frames_from(first + i, per), 0, bytes);
      const auto time_us = static_cast<std::int64_t>(1'700'000'000'000'000 + 1000 * (first + i));
      ASSERT_TRUE(log->append(protocol::frames_channel, bytes, time_us));
    }
  }
  void append_description(const std::string& rig) {
    protocol::Description description;
    description.rig = rig;
    append(protocol::recording_channel, protocol::info_of(description, -1), 0);
  }
  RecordingIndex index() {
    EXPECT_TRUE(log->close());
    return {file, {}};
  }

  std::filesystem::path file = std::filesystem::temp_directory_path() /
                               ("stickslip-index-" + std::to_string(::getpid()) + ".log");
  std::optional<protocol::LogWriter> log{std::in_place, file};
};

TEST_F(RecordingIndexTest, PiecesHoldEveryFrameOnceAndWhatWasRecordedWithThem) {
  append_description("bench 7");
  append_frames(1, 12000);
  friction_estimate_t estimate{};
  estimate.time_ns = 12'000'000'000;
  append(protocol::estimate_channel, estimate, 0);
  append(protocol::event_channel, note_at(12'000'000'000, "weights changed"), 0);
  append_frames(12001, 1000);
  const RecordingIndex recording = index();
  ASSERT_EQ(recording.pieces(), 3U);
  std::int64_t next = 1;
  std::vector<std::string> types;
  for (std::size_t i = 0; i < recording.pieces(); ++i) {
    const Read piece = read_piece(recording.piece(i));
    EXPECT_LE(piece.blocks.size(), RecordingIndex::piece_frames / 10);
    for (const test::ReadBlock& block : piece.blocks) {
      for (const std::int64_t sequence : block.sequence) EXPECT_EQ(sequence, next++);
      EXPECT_NEAR(block.received_unix_ms, 1.7e12 + static_cast<double>(block.sequence[0]), 1e-3);
    }
    for (const json& text : piece.texts) types.push_back(text["type"]);
  }
  EXPECT_EQ(next, 13001);
  EXPECT_EQ(types,
            (std::vector<std::string>{"model", "source", "source", "source", "estimate", "event"}));
  const json summary = json::parse(recording.summary());
  EXPECT_EQ(summary["frames"], 13000);
  EXPECT_EQ(summary["first_ns"], "1000000");
  EXPECT_EQ(summary["length_ns"], 12'999'000'000);
  EXPECT_EQ(summary["pieces"], (json{0, 5'000'000'000, 10'000'000'000}));
  ASSERT_EQ(summary["events"].size(), 1U);
  EXPECT_EQ(summary["events"][0]["message"], "weights changed");
  ASSERT_EQ(summary["models"].size(), 1U);
  EXPECT_EQ(summary["models"][0]["message"]["rig"], "bench 7");
}

TEST_F(RecordingIndexTest, TheOverviewHasTheExtremesOfEverySpan) {
  append_frames(1, 12000);
  const json overview = json::parse(index().summary())["overview"];
  const auto step = overview["step_ns"].get<std::int64_t>();
  const json& low = overview["low"][0];
  const json& high = overview["high"][0];
  ASSERT_EQ(low.size(), high.size());
  ASSERT_EQ(low.size(), static_cast<std::size_t>(11'999'000'000 / step + 1));
  EXPECT_LE(low.size(), Overview::most);
  EXPECT_GT(low.size(), Overview::most / 2);
  // Displacement is the number of the frame.
  for (std::size_t i = 0; i < low.size(); ++i) {
    const std::int64_t from = (static_cast<std::int64_t>(i) * step + 999'999) / 1'000'000;
    const std::int64_t to = (static_cast<std::int64_t>(i + 1) * step + 999'999) / 1'000'000;
    EXPECT_EQ(low[i].get<double>(), static_cast<double>(from + 1)) << i;
    EXPECT_EQ(high[i].get<double>(), static_cast<double>(std::min<std::int64_t>(to, 12000))) << i;
  }
}

TEST(Overview, OfTenHoursIsNoLargerThanOfAMinute) {
  Overview overview;
  Frame frame;
  for (std::int64_t second = 0; second < 36000; ++second) {
    frame.set(Channel::velocity, static_cast<double>(second % 100));
    overview.add(frame, second * 1'000'000'000);
  }
  EXPECT_LE(overview.size(), Overview::most);
  EXPECT_EQ(overview[0].low[index_of(Channel::velocity)], 0.0F);
  EXPECT_GT(overview[0].low[index_of(Channel::displacement)],
            overview[0].high[index_of(Channel::displacement)])
      << "not measured";
}

TEST_F(RecordingIndexTest, WhatCannotBeShownIsCountedAndTheRestIsShown) {
  append_frames(1, 6000);
  append_frames(100, 20);  // back in time
  ASSERT_TRUE(log->append(protocol::event_channel, std::vector<std::uint8_t>(5), 0));
  append_frames(6001, 1000);
  const RecordingIndex recording = index();
  EXPECT_EQ(recording.unshown().undecoded, 3U);
  std::int64_t next = 1;
  for (std::size_t i = 0; i < recording.pieces(); ++i) {
    for (const test::ReadBlock& block : read_piece(recording.piece(i)).blocks) {
      for (const std::int64_t sequence : block.sequence) EXPECT_EQ(sequence, next++);
    }
  }
  EXPECT_EQ(next, 7001);
}

TEST_F(RecordingIndexTest, ALogThatWasCutOffIsShownUpToThere) {
  append_frames(1, 6000);
  ASSERT_TRUE(log->close());
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 100);
  const RecordingIndex recording{file, {}};
  EXPECT_GT(recording.unshown().cut_off_bytes, 0);
  EXPECT_EQ(read_piece(recording.piece(1)).blocks.back().sequence.back(), 5990);
}

TEST_F(RecordingIndexTest, OtherFilesAreRefusedWithARemedy) {
  ASSERT_TRUE(log->close());
  EXPECT_THROW((RecordingIndex{file, {}}), InputError) << "without frames";
  std::ofstream(file) << "time_s,velocity_m_s\n1,2\n";
  try {
    const RecordingIndex csv{file, {}};
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("stickslip convert"), std::string::npos);
  }
}

}  // namespace
}  // namespace stickslip::scope
