// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/live_feed.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stickslip/recording_info_t.hpp>

#include "config/model_file.h"
#include "messages.h"
#include "protocol/channels.h"
#include "protocol/frame_block.h"

namespace stickslip::scope {
namespace {

using namespace std::chrono_literals;
using test::frame_at;
using test::frames_from;
using test::read_block;
using test::read_json;

template <class Type>
std::vector<std::uint8_t> encoded(const Type& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  EXPECT_EQ(message.encode(bytes.data(), 0, static_cast<int>(bytes.size())),
            static_cast<int>(bytes.size()));
  return bytes;
}

event_t event_of(const std::string& code) {
  event_t event{};
  event.code = code;
  event.message = "a sentence";
  return event;
}

/// A feed and the messages it has sent.
class LiveFeedTest : public testing::Test {
 protected:
  void frames(const std::vector<Frame>& frames, int flags = 0) {
    std::vector<std::uint8_t> bytes;
    protocol::encode_block(frames, flags, bytes);
    feed.take(protocol::frames_channel, bytes, 1.0e12, now);
  }
  template <class Type>
  void take(const char* channel, const Type& message) {
    feed.take(channel, encoded(message), 1.0e12, now);
  }
  /// Types of the messages since the last call, without heartbeats; "frames" for blocks.
  std::vector<std::string> types() {
    std::vector<std::string> out = types_of(sent);
    std::erase(out, "alive");
    sent.clear();
    return out;
  }
  static std::vector<std::string> types_of(const std::vector<SharedMessage>& messages) {
    std::vector<std::string> out;
    for (const SharedMessage& message : messages) {
      out.push_back(message->binary() ? "frames" : read_json(*message)["type"].get<std::string>());
    }
    return out;
  }

  std::vector<SharedMessage> sent;
  LiveFeed::Clock::time_point now = LiveFeed::Clock::now();
  LiveFeed feed{FeedSettings{}, [this](const SharedMessage& message) { sent.push_back(message); }};
};

using Types = std::vector<std::string>;

TEST_F(LiveFeedTest, SendsABlockImmediately) {
  frames(frames_from(1, 10), 1);
  ASSERT_EQ(types_of(sent), (Types{"source", "frames"}));
  EXPECT_EQ(read_json(*sent[0])["connected"], true);
  const auto block = read_block(*sent[1]);
  EXPECT_EQ(block.flags, 1U);
  EXPECT_EQ(block.received_unix_ms, 1.0e12);
  EXPECT_EQ(block.sequence.size(), 10U);
}

TEST_F(LiveFeedTest, ANewPageReceivesTheNotesOfTheRun) {
  frames(frames_from(1, 10));
  event_t note = event_of("note");
  note.message = "weights changed";
  take(protocol::event_channel, note);
  take(protocol::event_channel, event_of("overrun"));
  const auto greeting = feed.greeting(now);
  ASSERT_EQ(types_of(greeting), (Types{"hello", "source", "frames", "event", "alive"}));
  EXPECT_EQ(read_json(*greeting[3])["message"], "weights changed");
  frames(frames_from(1, 10));  // the daemon was restarted
  EXPECT_EQ(types_of(feed.greeting(now)), (Types{"hello", "source", "frames", "alive"}));
}

TEST_F(LiveFeedTest, ReportsSilenceAndItsEndOnce) {
  frames(frames_from(1, 10));
  types();
  now += 900ms;
  feed.tick(now);
  EXPECT_EQ(types(), Types{});
  now += 200ms;
  feed.tick(now);
  ASSERT_EQ(types_of(sent), Types{"source"});
  EXPECT_EQ(read_json(*sent[0])["connected"], false);
  EXPECT_NEAR(read_json(*sent[0])["silent_s"].get<double>(), 1.1, 1e-9);
  types();
  feed.tick(now + 5s);
  EXPECT_EQ(types(), Types{});
  now += 9s;
  frames(frames_from(11, 10));
  EXPECT_EQ(types(), (Types{"source", "frames"}));
}

TEST_F(LiveFeedTest, BeatsWhileTheRigIsSilentAndSaysHowOldItsStatusIs) {
  take(protocol::status_channel, status_t{});
  frames(frames_from(1, 10));
  sent.clear();
  int beats = 0;
  for (int i = 0; i < 40; ++i) {
    now += 100ms;
    feed.tick(now);
    const std::vector<std::string> seen = types_of(sent);
    beats += static_cast<int>(std::count(seen.begin(), seen.end(), "alive"));
    if (i < 39) sent.clear();
  }
  EXPECT_GE(beats, 10) << "in four seconds";
  EXPECT_LE(beats, 16);
  feed.tick(now + 300ms);
  const auto beat = read_json(*sent.back());
  EXPECT_EQ(beat["type"], "alive");
  EXPECT_EQ(beat["connected"], false);
  EXPECT_NEAR(beat["silent_s"].get<double>(), 4.3, 1e-9);
  EXPECT_NEAR(beat["status_s"].get<double>(), 4.3, 1e-9);
}

TEST_F(LiveFeedTest, GreetsWithTheSilenceOfTheSource) {
  feed.tick(now + 10s);
  EXPECT_EQ(types(), Types{});
  const auto greeting = feed.greeting(now + 10s);
  ASSERT_EQ(types_of(greeting), (Types{"hello", "source", "alive"}));
  EXPECT_EQ(read_json(*greeting[1])["connected"], false);
  EXPECT_GE(read_json(*greeting[1])["silent_s"].get<double>(), 9.0);
}

TEST_F(LiveFeedTest, ReportsARestartBeforeItsFrames) {
  frames(frames_from(1000, 10));
  types();
  frames(frames_from(0, 10));
  EXPECT_EQ(types(), (Types{"restart", "frames"}));
  const auto greeting = feed.greeting(now);
  ASSERT_EQ(types_of(greeting), (Types{"hello", "source", "frames", "alive"}));
  EXPECT_EQ(read_block(*greeting[2]).sequence.front(), 0) << "no frames of the previous run";
}

TEST_F(LiveFeedTest, TimeBackByMoreThanASecondIsARestart) {
  frames(frames_from(5000, 10));
  frames(frames_from(9000, 10));
  types();
  auto back = frames_from(9010, 10);
  for (Frame& frame : back) frame.time_ns -= 500'000'000;
  frames(back);
  EXPECT_EQ(types(), Types{"frames"}) << "half a second is not a restart";
  auto restarted = frames_from(9020, 10);
  for (Frame& frame : restarted) frame.time_ns -= 3'000'000'000;
  frames(restarted);
  EXPECT_EQ(types(), (Types{"restart", "frames"}));
}

TEST_F(LiveFeedTest, CountsAndDropsUndecodableMessages) {
  frames(frames_from(1, 10));
  types();
  const std::vector<std::uint8_t> rubbish(100, 0xFF);
  for (const auto& channel : protocol::lcm_channels) {
    feed.take(channel.name, rubbish, 0.0, now);
    feed.take(channel.name, {}, 0.0, now);
  }
  feed.take("STICKSLIP_OF_LATER", rubbish, 0.0, now);
  feed.take("SOMETHING", rubbish, 0.0, now);
  EXPECT_EQ(types(), Types{});
  EXPECT_EQ(feed.undecoded(), 2 * protocol::lcm_channels.size());
  frames(frames_from(11, 10));
  EXPECT_EQ(types(), Types{"frames"});
}

TEST_F(LiveFeedTest, SendsTheExcitationWithTheTimesOfItsFrames) {
  auto odd = frames_from(1, 10);
  odd[6].time_ns += 17;
  frames(odd);
  types();
  excitation_t excitation{};
  excitation.sequence = 10;
  excitation.time_ns = 10'000'000;
  excitation.earlier = 2;
  excitation.earlier_by = {3, 1};
  excitation.earlier_drive = {0.0, 0.0};
  excitation.earlier_amplitude = {0.0F, 0.0F};
  excitation.earlier_phase_rad = {0.0F, 0.0F};
  excitation.earlier_state = {0, 0};
  take(protocol::excitation_channel, excitation);
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(read_json(*sent[0])["time_ns"], nlohmann::json({7'000'017, 9'000'000, 10'000'000}));
}

TEST_F(LiveFeedTest, GreetsWithThePresentState) {
  recording_info_t description{};
  description.rig = "a rig";
  description.model = config::model_text(
      config::load_model(std::string(STICKSLIP_SOURCE_DIR) + "/config/models/simulated.toml"));
  take(protocol::recording_channel, description);
  take(protocol::status_channel, status_t{});
  take(protocol::timing_channel, timing_t{});
  take(protocol::recorder_channel, recorder_t{});
  take(protocol::estimate_channel, friction_estimate_t{});
  take(protocol::event_channel, event_of("started"));
  take(protocol::event_channel, event_of("model_follows"));
  take(protocol::event_channel, event_of("model_broken"));
  take(protocol::event_channel, event_of("model_broken"));
  take(protocol::event_channel, event_of("model_explained"));
  take(protocol::event_channel, event_of("model_follows"));
  frames(frames_from(1, 1500));
  const auto greeting = feed.greeting(now);
  EXPECT_EQ(types_of(greeting),
            (Types{"hello", "model", "source", "frames", "frames", "status", "timing", "recorder",
                   "estimate", "event", "event", "event", "alive"}));
  EXPECT_EQ(read_json(*greeting[1])["rig"], "a rig");
  EXPECT_EQ(read_json(*greeting[1])["marks"].size(), 2U);
  EXPECT_EQ(read_json(*greeting[9])["code"], "model_broken");
  EXPECT_EQ(read_json(*greeting[10])["code"], "model_explained");
  EXPECT_EQ(read_json(*greeting[11])["code"], "model_follows") << "the current one is last";
  EXPECT_EQ(read_block(*greeting[3]).flags, 2U);
}

TEST_F(LiveFeedTest, SendsADescriptionThatIsRepeatedOnce) {
  recording_info_t description{};
  description.rig = "a rig";
  take(protocol::recording_channel, description);
  take(protocol::recording_channel, description);
  EXPECT_EQ(types(), Types{"model"});
  description.rig = "another";
  take(protocol::recording_channel, description);
  EXPECT_EQ(types(), Types{"model"});
}

TEST_F(LiveFeedTest, PublishesTheRigOfAnInvalidModel) {
  recording_info_t description{};
  description.rig = "a rig";
  description.model = "this is [ no model";
  take(protocol::recording_channel, description);
  ASSERT_EQ(types_of(sent), Types{"model"});
  EXPECT_EQ(read_json(*sent[0])["rig"], "a rig");
  EXPECT_TRUE(read_json(*sent[0])["marks"].empty());
}

}  // namespace
}  // namespace stickslip::scope
