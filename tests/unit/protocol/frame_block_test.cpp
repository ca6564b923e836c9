// SPDX-License-Identifier: Apache-2.0
#include "protocol/frame_block.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <vector>

#include "protocol/checksum.h"
#include "protocol/decode.h"

namespace stickslip::protocol {
namespace {

std::vector<Frame> frames(std::size_t count) {
  std::vector<Frame> out(count);
  for (std::size_t i = 0; i < count; ++i) {
    out[i].time_ns = static_cast<std::int64_t>(1'000'000 * i);
    out[i].sequence = 10 + i;
    for (const Channel channel : all_channels) {
      if ((i + index_of(channel)) % 3 != 0) {
        out[i].set(channel, 0.1 * static_cast<double>(i) - static_cast<double>(index_of(channel)));
      }
    }
  }
  return out;
}

TEST(FrameBlock, ConvertsFramesAndBack) {
  const std::vector<Frame> before = frames(7);
  frame_block_t block;
  to_block(before, block);
  EXPECT_EQ(block.count, 7);
  EXPECT_EQ(block.flags, 0);
  EXPECT_EQ(block.base_displacement_m[3], before[3][Channel::base_displacement]);
  std::vector<Frame> after = frames(1);  // appended to, not replaced
  ASSERT_TRUE(from_block(block, after));
  ASSERT_EQ(after.size(), 8U);
  after.erase(after.begin());
  EXPECT_EQ(after, before);
}

TEST(FrameBlock, DirectEncodingIsTheSameToTheBit) {
  std::mt19937_64 random(20240711);
  std::vector<std::uint8_t> direct;
  for (int round = 0; round < 200; ++round) {
    std::vector<Frame> some = frames(1 + random() % 40);
    for (Frame& frame : some) {
      frame.sequence = random();
      frame.time_ns = static_cast<std::int64_t>(random());
      for (const Channel channel : all_channels) {
        if (round % 3 == 0 && frame.has(channel) && random() % 2 == 0) {
          frame.age_us[index_of(channel)] = static_cast<std::int32_t>(random() % 100'000);
        }
      }
    }
    frame_block_t block;
    to_block(some, block);
    block.flags = static_cast<std::int32_t>(random() % 2);
    std::vector<std::uint8_t> by_block(static_cast<std::size_t>(block.getEncodedSize()));
    block.encode(by_block.data(), 0, static_cast<int>(by_block.size()));
    encode_block(some, block.flags, direct);
    ASSERT_EQ(direct, by_block) << "round " << round;
  }
}

TEST(FrameBlock, AgesAreEncodedForChannelsThatHaveOne) {
  std::vector<Frame> before = frames(5);
  for (std::size_t i = 0; i < before.size(); ++i) {
    before[i].set(Channel::base_displacement, 1.0);
    before[i].age_us[index_of(Channel::base_displacement)] = static_cast<std::int32_t>(700 * i);
  }
  frame_block_t block;
  to_block(before, block);
  ASSERT_EQ(block.aged, 1);
  EXPECT_EQ(block.aged_channel[0], index_of(Channel::base_displacement));
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(block.getEncodedSize()));
  block.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  std::vector<std::uint8_t> direct = {1, 2, 3};  // overwritten
  encode_block(before, 0, direct);
  EXPECT_EQ(direct, bytes);
  frame_block_t heard;
  ASSERT_TRUE(decode(bytes, heard));
  std::vector<Frame> after;
  ASSERT_TRUE(from_block(heard, after));
  EXPECT_EQ(after, before);
  // A repeated channel, one that does not exist, and a count without rows.
  for (const std::uint8_t wrong : {std::uint8_t{4}, std::uint8_t{9}}) {
    frame_block_t bad = block;
    bad.aged = 2;
    bad.aged_channel.push_back(wrong);
    bad.age_us.push_back(bad.age_us[0]);
    EXPECT_FALSE(from_block(bad, after));
  }
  block.aged = 0;
  EXPECT_FALSE(from_block(block, after));
}

TEST(FrameBlock, AgesOfThePreviousBlockAreCleared) {
  std::vector<Frame> aged(3);
  for (std::size_t i = 0; i < aged.size(); ++i) {
    aged[i].set(Channel::normal_load, 2.0);
    aged[i].age_us[index_of(Channel::normal_load)] = 700;
  }
  std::vector<Frame> plain(3);
  for (Frame& frame : plain) frame.set(Channel::displacement, 1.0);
  frame_block_t received{};
  for (const auto& frames : {aged, plain, aged, plain}) {
    frame_block_t sent{};
    to_block(frames, sent);
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(sent.getEncodedSize()));
    sent.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    std::vector<Frame> after;
    ASSERT_TRUE(decode(bytes, received));
    ASSERT_TRUE(from_block(received, after));
    EXPECT_EQ(after, frames);
  }
}

TEST(FrameBlock, RefillOfTheSameOrASmallerSizeDoesNotAllocate) {
  frame_block_t block;
  to_block(frames(10), block);
  const auto* times = block.time_ns.data();
  const auto* values = block.drive_force_n.data();
  for (const std::size_t count : {3U, 10U, 1U, 10U}) {
    to_block(frames(count), block);
    EXPECT_EQ(block.time_ns.data(), times);
    EXPECT_EQ(block.drive_force_n.data(), values);
    EXPECT_EQ(block.valid.size(), count);
  }
}

TEST(FrameBlock, InvariantsOfAFrameAreRestored) {
  frame_block_t block;
  Frame frame;
  frame.set(Channel::velocity, 1.0);
  frame.set(Channel::displacement, 2.0);
  frame.set(Channel::normal_load, 3.0);
  to_block(std::vector<Frame>{frame}, block);
  block.valid[0] = 0b11000011;  // two bits of no channel; the normal load's bit taken away
  block.velocity_m_s[0] = std::numeric_limits<double>::quiet_NaN();
  std::vector<Frame> out;
  ASSERT_TRUE(from_block(block, out));
  Frame expected;
  expected.set(Channel::displacement, 2.0);
  EXPECT_EQ(out.at(0), expected);
}

TEST(FrameBlock, RefusesAnInconsistentBlock) {
  std::vector<Frame> out;
  for (const std::int32_t count : {-1, 0, 2, 4}) {
    frame_block_t block;
    to_block(frames(3), block);
    block.count = count;
    EXPECT_FALSE(from_block(block, out)) << count;
  }
  frame_block_t block;
  to_block(frames(3), block);
  block.drive_force_n.pop_back();
  EXPECT_FALSE(from_block(block, out));
  EXPECT_TRUE(out.empty());
}

TEST(Checksum, BlockAndBytewiseResultsAgree) {
  std::mt19937 random(3);
  for (std::size_t size = 0; size < 100; ++size) {
    std::vector<std::uint8_t> bytes(size);
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
    Checksum direct;
    Checksum one_by_one;
    direct.add(std::uint8_t{7});  // so that it does not begin with a fresh sum
    one_by_one.add(std::uint8_t{7});
    direct.add(std::span<const std::uint8_t>(bytes));
    for (const std::uint8_t byte : bytes) one_by_one.add(byte);
    ASSERT_EQ(direct.value(), one_by_one.value()) << size << " bytes";
  }
}

TEST(Checksum, AgreesWithZlib) {
  Checksum sum;
  for (const char c : {'1', '2', '3', '4', '5', '6', '7', '8', '9'}) {
    sum.add(static_cast<std::uint8_t>(c));
  }
  EXPECT_EQ(sum.value(), 0xCBF43926U);  // the published check value of CRC-32
  EXPECT_EQ(Checksum().value(), 0U);
}

TEST(Checksum, NumberIsEncodedInEightBytes) {
  Checksum by_bytes;
  Checksum by_number;
  const std::int64_t number = 0x0123456789ABCDEF;
  for (int pass = 0; pass < 3; ++pass) {
    by_number.add_encoded(number);
    for (const int byte : {0x01, 0x23, 0x45, 0x67, 0x89, 0xAB, 0xCD, 0xEF}) {
      by_bytes.add(static_cast<std::uint8_t>(byte));
    }
    EXPECT_EQ(by_number.value(), by_bytes.value());
  }
}

}  // namespace
}  // namespace stickslip::protocol
