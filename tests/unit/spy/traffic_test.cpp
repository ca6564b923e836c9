// SPDX-License-Identifier: Apache-2.0
// Statistics per channel.
#include "tools/spy/traffic.h"

#include <gtest/gtest.h>

#include <stickslip/event_t.hpp>
#include <stickslip/status_t.hpp>

#include "messages.h"
#include "protocol/channels.h"

namespace stickslip::spy {
namespace {

using protocol::frames_channel;

const ChannelTraffic& only(const Traffic& traffic) { return *traffic.channels().at(0); }

TEST(Traffic, CountsLossesBySequenceNumbers) {
  Traffic traffic;
  traffic.add(frames_channel, block_of({1, 2, 3}), 0);
  traffic.add(frames_channel, block_of({7, 8}), 10'000);  // 4, 5, 6 are lost
  traffic.add(frames_channel, block_of({10}), 20'000);    // and 9
  traffic.add(frames_channel, block_of({1, 2}), 30'000);  // a restart: no loss
  const ChannelTraffic& seen = only(traffic);
  EXPECT_EQ(seen.messages, 4U);
  EXPECT_EQ(seen.sequence.frames, 8U);
  EXPECT_EQ(seen.sequence.lost, 4U);
  EXPECT_EQ(seen.sequence.gaps, 2U);
  EXPECT_EQ(seen.sequence.restarts, 1U);
  EXPECT_EQ(seen.undecoded, 0U);
  EXPECT_TRUE(traffic.has_frames());
}

TEST(Traffic, KeepsLastValueAndRange) {
  Traffic traffic;
  traffic.add(frames_channel, block_of({1, 2, 30}), 0);
  traffic.add(frames_channel, block_of({31, 32}), 10);
  ASSERT_EQ(only(traffic).quantities.size(), 1U);
  const Quantity& displacement = only(traffic).quantities[0];
  EXPECT_EQ(displacement.name, "displacement");
  EXPECT_EQ(displacement.unit, "m");
  EXPECT_DOUBLE_EQ(displacement.last, 0.032);
  EXPECT_DOUBLE_EQ(displacement.least, 0.001);
  EXPECT_DOUBLE_EQ(displacement.greatest, 0.032);
}

TEST(Traffic, MeasuresRatesAndJitterWithinAnInterval) {
  Traffic traffic;
  const std::vector<std::uint8_t> bytes(100);
  for (const std::int64_t at_us : {0, 10'000, 20'000, 35'000}) traffic.add("OTHER", bytes, at_us);
  traffic.close_interval(2.0);
  EXPECT_DOUBLE_EQ(only(traffic).rate_per_s, 2.0);
  EXPECT_DOUBLE_EQ(only(traffic).bytes_per_s, 200.0);
  EXPECT_DOUBLE_EQ(only(traffic).jitter_s.value(), 0.005);
  traffic.close_interval(2.0);
  EXPECT_DOUBLE_EQ(only(traffic).rate_per_s, 0.0);
  EXPECT_FALSE(only(traffic).jitter_s.has_value());
  EXPECT_EQ(only(traffic).messages, 4U);  // since the start
  EXPECT_DOUBLE_EQ(only(traffic).age_s(1'035'000), 1.0);
}

TEST(Traffic, CountsMessagesThatCannotBeDecoded) {
  Traffic traffic;
  std::vector<std::uint8_t> block = block_of({1, 2});
  block.pop_back();
  traffic.add(frames_channel, block, 0);
  traffic.add(frames_channel, {}, 1);
  traffic.add(frames_channel, encoded(event_t{}), 2);
  EXPECT_EQ(only(traffic).undecoded, 3U);
  EXPECT_EQ(only(traffic).type, "frame_block_t");
  EXPECT_FALSE(traffic.has_frames());
}

TEST(Traffic, RecognisesTypesOnOtherChannels) {
  Traffic traffic;
  traffic.add("MY_COPY", block_of({1, 2, 5}), 0);
  EXPECT_EQ(only(traffic).type, "frame_block_t");
  EXPECT_EQ(only(traffic).sequence.lost, 2U);
}

TEST(Traffic, ReportsTheFingerprintOfUnknownTypes) {
  Traffic traffic;
  traffic.add("OTHER", std::vector<std::uint8_t>{1, 2, 3, 4, 5, 6, 7, 8, 9}, 0);
  EXPECT_EQ(only(traffic).type, "");
  EXPECT_EQ(only(traffic).fingerprint, 0x0102030405060708U);
  EXPECT_EQ(only(traffic).undecoded, 0U);  // no type is expected on this channel
  traffic.add("OTHER", std::vector<std::uint8_t>{1, 2}, 0);
  EXPECT_EQ(only(traffic).fingerprint, 0U);
}

TEST(Traffic, RatesTheSeverityOfAState) {
  status_t status{};
  status.state = "faulted";
  status.interlock = "overrun";
  status.cause = "12 cycles late";
  Traffic traffic;
  traffic.add(protocol::status_channel, encoded(status), 0);
  EXPECT_EQ(only(traffic).tone, terminal::Tone::bad);
  EXPECT_NE(only(traffic).summary.find("overrun: 12 cycles late"), std::string::npos);
  status.state = "running";
  status.cause.clear();
  traffic.add(protocol::status_channel, encoded(status), 0);
  EXPECT_EQ(only(traffic).tone, terminal::Tone::good);
  status.degraded = true;
  traffic.add(protocol::status_channel, encoded(status), 0);
  EXPECT_EQ(only(traffic).tone, terminal::Tone::warning);
}

}  // namespace
}  // namespace stickslip::spy
