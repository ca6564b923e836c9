// SPDX-License-Identifier: Apache-2.0
#include "protocol/decode.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "protocol/frame_block.h"

namespace stickslip::protocol {
namespace {

using Bytes = std::vector<std::uint8_t>;

template <class Message>
Bytes encoded(const Message& message) {
  Bytes bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

frame_block_t some(frame_block_t) {
  std::vector<Frame> frames(5);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    frames[i].time_ns = static_cast<std::int64_t>(i);
    frames[i].set(Channel::velocity, 0.5 * static_cast<double>(i));
  }
  frame_block_t block;
  to_block(frames, block);
  return block;
}

friction_estimate_t some(friction_estimate_t) {
  friction_estimate_t estimate{};
  estimate.state_count = 3;
  estimate.state_name = {"displacement_m", "", "mu"};
  estimate.state = {1, 2, 3};
  estimate.covariance = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  return estimate;
}

excitation_t some(excitation_t) {
  excitation_t excitation{};
  excitation.drive = 1.0;
  excitation.earlier = 2;
  excitation.earlier_by = {3, 1};
  excitation.earlier_drive = {0.5, 0.75};
  excitation.earlier_amplitude = {1.0F, 1.0F};
  excitation.earlier_phase_rad = {0.1F, 0.2F};
  excitation.earlier_state = {0, 0x80};
  return excitation;
}

status_t some(status_t) {
  status_t status{};
  status.state = "running";
  status.publish_loss_count = 2;
  status.publish_loss_name = {"ring full", "socket"};
  status.publish_loss = {3, 4};
  status.record_loss_count = 1;
  status.record_loss_name = {"disk"};
  status.record_loss = {5};
  status.degraded = 1;
  return status;
}

timing_t some(timing_t) {
  timing_t timing{};
  timing.bins = 2;
  timing.upper_edge_ns = {1, 2};
  timing.lateness = {3, 4};
  timing.cycle = {5, 6};
  timing.read = {7, 8};
  return timing;
}

event_t some(event_t) {
  event_t event{};
  event.code = "overrun";
  event.message = "a cycle took 1.2 ms";
  return event;
}

recording_info_t some(recording_info_t) {
  recording_info_t info{};
  info.rig = "bench";
  info.configuration = "[rig]\n";
  return info;
}

recorder_t some(recorder_t) {
  recorder_t recorder{};
  recorder.file = "/data/run.001.log";
  recorder.part = 1;
  recorder.free_bytes = -1;
  return recorder;
}

void write_int32(Bytes& bytes, std::size_t at, std::uint32_t value) {
  for (std::size_t i = 0; i < 4; ++i) {
    bytes[at + i] = static_cast<std::uint8_t>(value >> (24U - 8U * i));
  }
}

// `bytes` with the length of a text set to `length`.
Bytes with_text_length(Bytes bytes, const std::string& text, std::uint32_t length) {
  const auto at = std::search(bytes.begin(), bytes.end(), text.begin(), text.end());
  write_int32(bytes, static_cast<std::size_t>(at - bytes.begin()) - 4, length);
  return bytes;
}

template <class Message>
class Decode : public testing::Test {};
using Messages = testing::Types<frame_block_t, friction_estimate_t, excitation_t, status_t,
                                timing_t, event_t, recording_info_t, recorder_t>;
TYPED_TEST_SUITE(Decode, Messages);

TYPED_TEST(Decode, AcceptsEncodedMessages) {
  const Bytes bytes = encoded(some(TypeParam{}));
  TypeParam message{};
  ASSERT_TRUE(decode(bytes, message));
  EXPECT_EQ(encoded(message), bytes);
}

TYPED_TEST(Decode, RefusesEveryOtherLength) {
  const Bytes bytes = encoded(some(TypeParam{}));
  TypeParam message{};
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(decode(std::span(bytes).first(size), message)) << size;
  }
  Bytes longer = bytes;
  longer.push_back(0);
  EXPECT_FALSE(decode(longer, message));
}

TYPED_TEST(Decode, RefusesAnotherType) {
  Bytes bytes = encoded(some(TypeParam{}));
  bytes[0] = static_cast<std::uint8_t>(bytes[0] ^ 1U);
  TypeParam message{};
  EXPECT_FALSE(decode(bytes, message));
}

// Every possible position of a count or a length is set to values that make an unchecked decoder
// allocate gigabytes or overflow. An address-space limit detects only part of that, so the decoded
// message is checked as well: nothing in it may be larger than its bytes.
TYPED_TEST(Decode, DoesNotAllocateForFalseCounts) {
  const Bytes bytes = encoded(some(TypeParam{}));
  for (std::size_t at = 0; at + 4 <= bytes.size(); ++at) {
    for (const std::uint32_t value :
         {0xFFFFFFFFU, 0x80000000U, 0x7FFFFFFFU, 0x20000000U, 0x10000001U, 0x01000000U, 0U}) {
      Bytes damaged = bytes;
      write_int32(damaged, at, value);
      TypeParam message{};
      if (decode(damaged, message)) {
        EXPECT_EQ(message.getEncodedSize(), static_cast<int>(bytes.size()));
      }
      if constexpr (std::is_same_v<TypeParam, friction_estimate_t>) {
        EXPECT_LE(message.state_name.capacity(), bytes.size());
        EXPECT_LE(message.covariance.capacity(), bytes.size());
      } else if constexpr (std::is_same_v<TypeParam, status_t>) {
        EXPECT_LE(message.publish_loss_name.capacity(), bytes.size());
        EXPECT_LE(message.record_loss_name.capacity(), bytes.size());
      } else if constexpr (std::is_same_v<TypeParam, frame_block_t>) {
        EXPECT_LE(message.time_ns.capacity(), bytes.size());
      } else if constexpr (std::is_same_v<TypeParam, excitation_t>) {
        EXPECT_LE(message.earlier_drive.capacity(), bytes.size());
      }
    }
  }
}

TYPED_TEST(Decode, SurvivesRandomDamage) {
  const Bytes bytes = encoded(some(TypeParam{}));
  std::mt19937 random(1);
  for (int round = 0; round < 5000; ++round) {
    Bytes damaged = bytes;
    for (int i = 0; i < 3; ++i)
      damaged[8 + random() % (damaged.size() - 8)] = static_cast<std::uint8_t>(random());
    damaged.resize(random() % (damaged.size() + 1));
    TypeParam message{};
    (void)decode(damaged, message);
  }
}

/// `bytes` with another fingerprint and without `lacking` bytes at the end.
Bytes former(Bytes bytes, std::uint64_t fingerprint, std::size_t lacking) {
  for (std::size_t i = 8; i > 0; --i, fingerprint >>= 8U) {
    bytes[i - 1] = static_cast<std::uint8_t>(fingerprint);
  }
  bytes.resize(bytes.size() - lacking);
  return bytes;
}

// Fingerprints of the types of logs of format 2, from lcm-gen.
TEST(DecodeOlderVersion, AnExcitationWithoutEarlierFrames) {
  excitation_t excitation{};
  excitation.sequence = 9;
  excitation.drive = 1.5;
  excitation.amplifier_on = 1;
  const Bytes bytes = former(encoded(excitation), 0xEF474DC1C55BAEC7U, 4);
  excitation_t message = some(excitation_t{});
  ASSERT_TRUE(decode(bytes, message));
  EXPECT_EQ(encoded(message), encoded(excitation));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(decode(std::span(bytes).first(size), message)) << size;
  }
}

// Of logs written before estimates contained their consistency.
TEST(DecodeOlderVersion, AnEstimateWithoutItsConsistency) {
  friction_estimate_t estimate = some(friction_estimate_t{});
  estimate.mu = 0.8;
  const Bytes bytes = former(encoded(estimate), 0xEF306B050D44EA73U, 15 * 8);
  friction_estimate_t message{};
  message.nis_mean = 3.0;  // of another message
  ASSERT_TRUE(decode(bytes, message));
  EXPECT_EQ(message.mu, 0.8);
  EXPECT_EQ(message.nis_mean, 0.0);
  EXPECT_EQ(encoded(message), encoded(estimate));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(decode(std::span(bytes).first(size), message)) << size;
  }
}

TEST(DecodeOlderVersion, AStatusWithoutConfirmedFrames) {
  status_t status = some(status_t{});
  status.record_confirmed = -1;
  const Bytes bytes = former(encoded(status), 0xD60837B0454EEC63U, 8);
  status_t message{};
  ASSERT_TRUE(decode(bytes, message));
  EXPECT_EQ(message.record_confirmed, -1);
  EXPECT_EQ(encoded(message), encoded(status));
}

TEST(DecodeOlderVersion, ADescriptionWithoutAFaultScript) {
  recording_info_t info = some(recording_info_t{});
  info.frames = 77;
  const Bytes bytes = former(encoded(info), 0x019FE800B2CECE78U, 10);
  recording_info_t message;
  message.fault_script = "of another message";
  ASSERT_TRUE(decode(bytes, message));
  EXPECT_EQ(message.frames, 77);
  EXPECT_EQ(message.fault_script, "");
  EXPECT_EQ(encoded(message), encoded(info));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(decode(std::span(bytes).first(size), message)) << size;
  }
}

// The generated decoder subtracts 1, which is undefined for the smallest length; only sanitizers
// detect it.
TEST(DecodeText, RefusesImpossibleLengths) {
  for (const std::uint32_t length : {0x80000000U, 0x80000001U, 0xFFFFFFFFU, 0U, 0x7FFFFFFFU}) {
    recording_info_t info{};
    EXPECT_FALSE(
        decode(with_text_length(encoded(some(recording_info_t{})), "bench", length), info));
    event_t event{};
    EXPECT_FALSE(decode(with_text_length(encoded(some(event_t{})), "a cycle", length), event));
    friction_estimate_t estimate{};
    EXPECT_FALSE(
        decode(with_text_length(encoded(some(friction_estimate_t{})), "displ", length), estimate));
    status_t status{};
    EXPECT_FALSE(decode(with_text_length(encoded(some(status_t{})), "socket", length), status));
  }
}

TEST(DecodeFrameBlock, DetectsEveryFlippedBitOfTheFrames) {
  const Bytes bytes = encoded(some(frame_block_t{}));
  frame_block_t block;
  for (std::size_t at = 16; at < bytes.size(); ++at) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      Bytes damaged = bytes;
      damaged[at] = static_cast<std::uint8_t>(damaged[at] ^ (1U << bit));
      EXPECT_FALSE(decode(damaged, block)) << "byte " << at;
    }
  }
}

TEST(DecodeFrameBlock, FlagsAreNotPartOfTheChecksum) {
  frame_block_t block = some(frame_block_t{});
  block.flags = 1;
  frame_block_t again;
  ASSERT_TRUE(decode(encoded(block), again));
  EXPECT_EQ(again.flags, 1);
}

}  // namespace
}  // namespace stickslip::protocol
