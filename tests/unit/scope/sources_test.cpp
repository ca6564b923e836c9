// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/sources.h"

#include <gtest/gtest.h>

#include <stickslip/recording_info_t.hpp>
#include <stickslip/status_t.hpp>

#include "messages.h"
#include "protocol/channels.h"
#include "protocol/frame_block.h"

namespace stickslip::scope {
namespace {

using namespace std::chrono_literals;
using test::frames_from;
using test::read_block;
using test::read_json;

const std::string a = "10.0.0.1:40000";
const std::string b = "10.0.0.2:40001";

/// Two pages that chose and one that did not, with the messages that each received.
class SourcesTest : public testing::Test {
 protected:
  template <class Type>
  void take(const std::string& sender, const char* channel, const Type& message) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
    message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    sources.take(sender, channel, bytes, 0.0, now);
  }
  void frames(const std::string& sender, std::uint64_t first) {
    std::vector<std::uint8_t> bytes;
    protocol::encode_block(frames_from(first, 10), 0, bytes);
    sources.take(sender, protocol::frames_channel, bytes, 0.0, now);
  }
  void rig(const std::string& sender, const std::string& name) {
    recording_info_t description{};
    description.rig = name;
    take(sender, protocol::recording_channel, description);
  }
  /// A daemon that follows its predecessor at once, for 1.5 s in which `others` send, too.
  void restart_at_once(const std::string& again, const std::vector<std::string>& others = {}) {
    for (std::uint64_t i = 0; i < 15; ++i) {
      now += 100ms;
      if (i == 0) rig(again, "bench");
      frames(again, 10 * i);
      for (const std::string& other : others) frames(other, 10 + 10 * i);
      sources.tick(now);
    }
  }
  /// First numbers of the blocks that a page has received, -1 for a restart.
  std::vector<std::int64_t> blocks(const std::string& wanted) {
    std::vector<std::int64_t> out;
    for (const SharedMessage& message : got[wanted]) {
      if (message->binary())
        out.push_back(read_block(*message).sequence.front());
      else if (read_json(*message)["type"] == "restart")
        out.push_back(-1);
    }
    return out;
  }
  nlohmann::json latest(const std::string& wanted, const std::string& type) {
    nlohmann::json out;
    for (const SharedMessage& message : got[wanted]) {
      if (!message->binary() && read_json(*message)["type"] == type) out = read_json(*message);
    }
    return out;
  }

  std::map<std::string, std::vector<SharedMessage>> got = {{"", {}}, {a, {}}, {b, {}}};
  Sources::Clock::time_point now = Sources::Clock::now();
  Sources sources{FeedSettings{},
                  [this](const SharedMessage& message, const Sources::Wants& wants) {
                    for (auto& [wanted, messages] : got) {
                      if (wants(wanted)) messages.push_back(message);
                    }
                  }};
};

using Blocks = std::vector<std::int64_t>;

TEST_F(SourcesTest, TwoRigsAreNotMixed) {
  for (std::uint64_t i = 0; i < 3; ++i) {
    frames(a, 1000 + 10 * i);
    frames(b, 5 + 10 * i);
  }
  EXPECT_EQ(blocks(""), (Blocks{1000, 1010, 1020}));
  EXPECT_EQ(blocks(a), (Blocks{-1, 1000, 1010, 1020}));
  // Until b is known, a page that wants it sees the current one.
  EXPECT_EQ(blocks(b), (Blocks{1000, -1, 5, 15, 25}));
}

TEST_F(SourcesTest, SourcesAreListedByTheNamesOfTheirRigs) {
  rig(a, "bench");
  frames(a, 0);
  rig(b, "other bench");
  frames(b, 0);
  const auto list = latest("", "sources");
  EXPECT_EQ(list["current"], a);
  EXPECT_EQ(list["sources"],
            nlohmann::json::parse(R"([{"id": ")" + a +
                                  R"(", "former_ids": [], "rig": "bench", "connected": true},
          {"id": ")" + b + R"(", "former_ids": [], "rig": "other bench", "connected": true}])"));
  const auto greeting = sources.greeting(b, now);
  EXPECT_EQ(read_json(*greeting[0])["type"], "hello");
  EXPECT_EQ(read_json(*greeting[1]), list);
  EXPECT_EQ(read_json(*greeting[2])["rig"], "other bench");
}

TEST_F(SourcesTest, APageThatChoseNoneFollowsWhatIsLive) {
  frames(a, 1000);
  frames(b, 5);
  got[""].clear();
  for (int i = 0; i < 12; ++i) {
    now += 100ms;
    frames(b, 15 + 10 * static_cast<std::uint64_t>(i));
    sources.tick(now);
  }
  const Blocks seen = blocks("");
  ASSERT_GE(seen.size(), 3U);
  EXPECT_EQ(seen[0], -1) << "a new picture";
  EXPECT_EQ(seen[1], 5) << "with the history of the other source";
  EXPECT_EQ(latest(a, "source")["connected"], false);
  EXPECT_EQ(blocks(a), (Blocks{-1, 1000})) << "a page that chose stays with its source";
}

TEST_F(SourcesTest, ARestartedDaemonTakesThePlaceOfTheSilentOne) {
  frames(a, 1000);
  frames(b, 0);
  for (int i = 0; i < 15; ++i) {
    now += 100ms;
    frames(b, 10 + 10 * static_cast<std::uint64_t>(i));
    sources.tick(now);
  }
  frames("10.0.0.1:50000", 0);
  EXPECT_EQ(blocks(a), (Blocks{-1, 1000, -1, 0}));
  EXPECT_EQ(latest(a, "sources")["sources"].size(), 2U);
}

TEST_F(SourcesTest, ADaemonThatIsRestartedAtOnceReplacesItsPredecessor) {
  rig(b, "other bench");
  frames(b, 0);
  rig(a, "bench");
  frames(a, 1000);
  const std::string again = "10.0.0.1:50000";
  restart_at_once(again, {b});
  const auto list = latest(a, "sources")["sources"];
  ASSERT_EQ(list.size(), 2U);
  EXPECT_EQ(list[1]["id"], again);
  EXPECT_EQ(list[1]["former_ids"], nlohmann::json(std::vector<std::string>{a}));
  const Blocks seen = blocks(a);
  EXPECT_EQ(std::count(seen.begin(), seen.end(), -1), 2) << "its first message and the restart";
  EXPECT_EQ(seen.back(), 140) << "a page that chose the bench sees it still";
  EXPECT_EQ(blocks("").back(), 150);
}

TEST_F(SourcesTest, ARestartedDaemonReplacesAPredecessorWhoseRigWasNeverNamed) {
  // Descriptions are repeated every few seconds; a server that has just started may have had none.
  frames(a, 1000);
  const std::string again = "10.0.0.1:50000";
  restart_at_once(again);
  EXPECT_EQ(latest(a, "sources")["sources"].size(), 1U);
  EXPECT_EQ(blocks(a).back(), 140) << "a page that chose the predecessor sees its successor";
}

TEST_F(SourcesTest, ADaemonWithoutFramesKeepsItsPlace) {
  take(a, protocol::status_channel, status_t{});
  now += 1s;
  frames("10.0.0.1:50000", 0);
  EXPECT_EQ(latest("", "sources")["sources"].size(), 2U);
}

TEST_F(SourcesTest, ASilentSourceIsForgottenAndItsPagesSeeAnother) {
  frames(a, 1000);
  frames(b, 0);
  for (int i = 0; i < 62; ++i) {
    now += 1s;
    frames(a, 1010 + 10 * static_cast<std::uint64_t>(i));
    sources.tick(now);
  }
  EXPECT_EQ(latest("", "sources")["sources"].size(), 1U);
  const Blocks seen = blocks(b);
  EXPECT_EQ(std::count(seen.begin(), seen.end(), -1), 2) << "at its first message and its last";
  EXPECT_GE(seen.back(), 1010);
}

TEST_F(SourcesTest, TheirNumberIsLimited) {
  for (int i = 0; i < 100; ++i) frames("10.0.1." + std::to_string(i) + ":1", 0);
  EXPECT_EQ(latest("", "sources")["sources"].size(), Sources::most);
}

}  // namespace
}  // namespace stickslip::scope
