// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_u6/stream_decoder.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstdint>
#include <map>
#include <random>
#include <vector>

namespace stickslip::drivers::labjack_u6 {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Outcome = StreamDecoder::Outcome;

/// Counts at a position of a scan; never FFFF.
std::uint16_t truth(std::uint64_t scan, std::size_t channel) {
  return static_cast<std::uint16_t>((scan * 2654435761U + channel * 40503U) % 65521U);
}

void seal(Bytes& packet) {
  unsigned sum = 0;
  for (std::size_t i = 6; i < packet.size(); ++i) sum += packet[i];
  packet[4] = static_cast<std::uint8_t>(sum);
  packet[5] = static_cast<std::uint8_t>(sum >> 8U);
  sum = 0;
  for (std::size_t i = 1; i < 6; ++i) sum += packet[i];
  sum = sum / 256 + sum % 256;
  packet[0] = static_cast<std::uint8_t>(sum / 256 + sum % 256);
}

/// Sender of a stream, reduced to its bookkeeping.
class Board {
 public:
  Board(std::size_t channels, std::size_t samples_per_packet)
      : channels_(channels), samples_(samples_per_packet) {}

  /// The next packet; with `thrown_away` > 0 it reports that number of discarded scans, at the end
  /// of the scan in which it begins.
  Bytes packet(std::uint8_t error = 0, std::uint16_t thrown_away = 0) {
    Bytes bytes(14 + 2 * samples_, 0);
    bytes[1] = 0xF9;
    bytes[2] = static_cast<std::uint8_t>(4 + samples_);
    bytes[3] = 0xC0;
    bytes[6] = static_cast<std::uint8_t>(thrown_away);
    bytes[7] = static_cast<std::uint8_t>(thrown_away >> 8U);
    bytes[10] = counter_++;
    bytes[11] = error;
    bytes[12 + 2 * samples_] = backlog;
    if (thrown_away > 0) throw_away_ = thrown_away;
    for (std::size_t i = 0; i < samples_; ++i) {
      const std::uint16_t sample = next_sample();
      bytes[12 + 2 * i] = static_cast<std::uint8_t>(sample);
      bytes[13 + 2 * i] = static_cast<std::uint8_t>(sample >> 8U);
    }
    seal(bytes);
    return bytes;
  }
  /// Position of the next sample.
  std::size_t channel() const { return channel_; }
  std::uint64_t scan() const { return scan_; }
  std::uint8_t backlog = 0;

 private:
  std::uint16_t next_sample() {
    if (channel_ == 0 && throw_away_ > 0) dummy_ = true;
    const std::uint16_t sample = dummy_ ? 0xFFFF : truth(scan_, channel_);
    if (++channel_ == channels_) {
      channel_ = 0;
      scan_ += dummy_ ? throw_away_ : 1U;
      if (dummy_) throw_away_ = 0;
      dummy_ = false;
    }
    return sample;
  }

  std::size_t channels_;
  std::size_t samples_;
  std::uint8_t counter_ = 0;
  std::size_t channel_ = 0;
  std::uint64_t scan_ = 0;
  std::uint16_t throw_away_ = 0;
  bool dummy_ = false;
};

/// Compares every decoded scan with the truth.
struct Receiver {
  explicit Receiver(std::size_t channel_count) : channels(channel_count) {}

  bool receive(const StreamDecoder& decoder) {
    for (const Scan& scan : decoder.scans()) {
      if (scan.index < next) return false;
      for (std::size_t c = 0; c < channels; ++c) {
        if (scan.counts[c] != truth(scan.index, c)) return false;
      }
      missing += scan.index - next;
      next = scan.index + 1;
      ++received;
    }
    return true;
  }

  std::size_t channels;
  std::uint64_t next = 0;
  std::uint64_t received = 0;
  std::uint64_t missing = 0;
};

TEST(LabjackU6Stream, SamplesStraddlingPacketsMakeCompleteScans) {
  for (const std::size_t channels : {1U, 2U, 3U, 4U, 6U, 7U, 24U, 25U}) {
    for (const std::size_t samples : {1U, 2U, 10U, 24U, 25U}) {
      Board board(channels, samples);
      StreamDecoder decoder(static_cast<int>(channels), static_cast<int>(samples));
      Receiver receiver(channels);
      for (int i = 0; i < 600; ++i) {
        ASSERT_EQ(decoder.take(board.packet()), Outcome::ok);
        ASSERT_TRUE(receiver.receive(decoder));
      }
      EXPECT_EQ(receiver.received, 600 * samples / channels);
      EXPECT_EQ(receiver.missing, 0U);
      EXPECT_EQ(decoder.counts().scans, receiver.received);
    }
  }
}

TEST(LabjackU6Stream, LostPacketIsCountedAndTheNextCompleteScanIsCorrect) {
  Board board(4, 25);
  StreamDecoder decoder(4, 25);
  Receiver receiver(4);
  decoder.take(board.packet());  // scans 0 to 5 and one sample of 6
  ASSERT_TRUE(receiver.receive(decoder));
  board.packet();                // 6 to 11 and two samples of 12
  decoder.take(board.packet());  // the rest of 12, then 13 to 17
  ASSERT_TRUE(receiver.receive(decoder));
  EXPECT_EQ(receiver.missing, 7U);
  EXPECT_EQ(decoder.counts().packets_lost, 1U);
  EXPECT_EQ(decoder.counts().scans_lost, 7U);
}

TEST(LabjackU6Stream, LossesBeforeTheFirstPacketCount) {
  Board board(5, 25);
  StreamDecoder decoder(5, 25);
  board.packet();
  decoder.take(board.packet());
  ASSERT_EQ(decoder.scans().size(), 5U);
  EXPECT_EQ(decoder.scans()[0].index, 5U);
}

TEST(LabjackU6Stream, CorruptedPacketIsLost) {
  Board board(5, 25);
  StreamDecoder decoder(5, 25);
  Receiver receiver(5);
  Bytes damaged = board.packet();
  damaged[30] ^= 0x10U;
  EXPECT_EQ(decoder.take(damaged), Outcome::damaged);
  EXPECT_TRUE(decoder.scans().empty());
  EXPECT_EQ(decoder.take(board.packet()), Outcome::ok);
  ASSERT_TRUE(receiver.receive(decoder));
  EXPECT_EQ(receiver.missing, 5U);
  EXPECT_EQ(decoder.counts().damaged, 1U);
}

TEST(LabjackU6Stream, PacketsOfWrongFormatAreRejected) {
  Board board(5, 25);
  StreamDecoder decoder(5, 25);
  const Bytes good = board.packet();
  Bytes other = good;
  other[2] = 28;
  seal(other);
  EXPECT_EQ(decoder.take(other), Outcome::damaged);
  other = good;
  other[3] = 0xC1;
  seal(other);
  EXPECT_EQ(decoder.take(other), Outcome::damaged);
  EXPECT_EQ(decoder.take(std::span(good).first(62)), Outcome::damaged);
  EXPECT_EQ(decoder.take({}), Outcome::damaged);
  EXPECT_EQ(decoder.take(good), Outcome::ok);
  EXPECT_EQ(decoder.counts().packets_lost, 0U);
}

TEST(LabjackU6Stream, RepeatedPacketIsDropped) {
  Board board(3, 25);
  StreamDecoder decoder(3, 25);
  Receiver receiver(3);
  for (int i = 0; i < 300; ++i) {
    const Bytes packet = board.packet();
    ASSERT_EQ(decoder.take(packet), Outcome::ok);
    ASSERT_TRUE(receiver.receive(decoder));
    ASSERT_EQ(decoder.take(packet), Outcome::repeated);
    ASSERT_TRUE(decoder.scans().empty());
  }
  EXPECT_EQ(decoder.counts().repeated, 300U);
  EXPECT_EQ(receiver.missing, 0U);
}

TEST(LabjackU6Stream, DiscardedScansAreCountedExactly) {
  for (const std::size_t channels : {1U, 3U, 4U, 5U, 25U}) {
    for (int lead = 0; lead < 26;
         ++lead) {  // the dummy scan at every position, also straddling packets
      Board board(channels, 25);
      StreamDecoder decoder(static_cast<int>(channels), 25);
      Receiver receiver(channels);
      for (int i = 0; i < lead; ++i) decoder.take(board.packet());
      for (int i = 0; i < 40; ++i) {
        ASSERT_EQ(decoder.take(board.packet(59)), Outcome::ok);
      }
      receiver.next = receiver.channels > 0 ? decoder.counts().scans : 0;
      ASSERT_EQ(decoder.take(board.packet(60, 1234)), Outcome::ok);
      ASSERT_TRUE(receiver.receive(decoder)) << channels << " " << lead;
      for (int i = 0; i < 10; ++i) {
        ASSERT_EQ(decoder.take(board.packet()), Outcome::ok);
        ASSERT_TRUE(receiver.receive(decoder)) << channels << " " << lead;
      }
      EXPECT_EQ(receiver.missing, 1234U);
      EXPECT_EQ(decoder.counts().overflow_losses, 1234U);
      EXPECT_EQ(decoder.counts().overflows, 1U);
      EXPECT_EQ(decoder.counts().scans_lost, 1234U);
    }
  }
}

TEST(LabjackU6Stream, LostRecoveryReportEndsTheStream) {
  Board board(4, 25);
  StreamDecoder decoder(4, 25);
  decoder.take(board.packet(59));
  board.packet(60, 77);
  EXPECT_EQ(decoder.take(board.packet()), Outcome::uncountable);
  EXPECT_TRUE(decoder.scans().empty());
  EXPECT_EQ(decoder.take(board.packet()), Outcome::uncountable);
}

TEST(LabjackU6Stream, InconsistentRecoveryEndsTheStream) {
  for (const bool no_dummy : {true, false}) {
    Board board(4, 25);
    StreamDecoder decoder(4, 25);
    Bytes report = board.packet(60, no_dummy ? 0 : 5);
    report[6] = no_dummy ? 5 : 0;
    report[7] = 0;
    seal(report);
    EXPECT_EQ(decoder.take(report), Outcome::uncountable);
  }
}

TEST(LabjackU6Stream, BoardErrorIsReportedAndItsSamplesAreNotUsed) {
  Board board(5, 25);
  StreamDecoder decoder(5, 25);
  Receiver receiver(5);
  EXPECT_EQ(decoder.take(board.packet(55)), Outcome::error);
  EXPECT_EQ(decoder.error(), 55);
  EXPECT_EQ(decoder.take(board.packet()), Outcome::ok);
  ASSERT_TRUE(receiver.receive(decoder));
  EXPECT_EQ(receiver.missing, 5U);
}

TEST(LabjackU6Stream, BacklogIsReported) {
  Board board(5, 25);
  StreamDecoder decoder(5, 25);
  board.backlog = 200;
  decoder.take(board.packet());
  EXPECT_EQ(decoder.backlog(), 200);
}

/// A bus that loses, corrupts and repeats packets, and a late host, so that the board overflows.
RC_GTEST_PROP(LabjackU6Stream, FaultyBusYieldsNoWrongScan, ()) {
  const auto channels = *rc::gen::inRange<std::size_t>(1, 26);
  const auto samples = *rc::gen::inRange<std::size_t>(1, 26);
  std::mt19937 random(*rc::gen::arbitrary<std::uint32_t>());
  const auto chance = [&random](unsigned in) { return random() % in == 0; };
  Board board(channels, samples);
  StreamDecoder decoder(static_cast<int>(channels), static_cast<int>(samples));
  Receiver receiver(channels);
  std::uint64_t lost = 0, damaged = 0, repeated = 0, pending = 0;
  bool reported = true;  // no recovery report was lost since an overflow
  unsigned draining = 0;
  std::uint64_t corrupted_run = 0;
  for (int i = 0; i < 700; ++i) {
    if (draining == 0 && chance(200)) draining = static_cast<unsigned>(2 + random() % 30);
    Bytes packet;
    const bool report = draining == 1;
    if (draining > 1) {
      packet = board.packet(59);
    } else if (report) {
      packet = board.packet(60, static_cast<std::uint16_t>(1 + random() % 65535));
    } else {
      packet = board.packet();
    }
    if (draining > 0) --draining;
    // Recovery reports are not lost here: see the separate test.
    if (!report && chance(10) && corrupted_run < 250) {
      ++pending;
      ++corrupted_run;
      if (chance(2)) {
        const std::size_t at = random() % packet.size();
        packet[at] = static_cast<std::uint8_t>(packet[at] ^ (1U << random() % 8));
        ++damaged;
        RC_ASSERT(decoder.take(packet) == Outcome::damaged);
        RC_ASSERT(decoder.scans().empty());
      }
      continue;
    }
    corrupted_run = 0;
    lost += pending;
    pending = 0;
    const Outcome outcome = decoder.take(packet);
    if (outcome == Outcome::uncountable) {
      // At most two reports within the dummy scan of the first.
      RC_ASSERT(report && samples < channels);
      reported = false;
      break;
    }
    RC_ASSERT(outcome == Outcome::ok);
    RC_ASSERT(receiver.receive(decoder));
    if (chance(20)) {
      ++repeated;
      RC_ASSERT(decoder.take(packet) == Outcome::repeated);
    }
  }
  RC_ASSERT(decoder.counts().packets_lost == lost);
  RC_ASSERT(decoder.counts().damaged == damaged);
  RC_ASSERT(decoder.counts().repeated == repeated);
  RC_ASSERT(decoder.counts().scans_lost == receiver.missing);
  if (reported) RC_ASSERT(decoder.counts().scans == receiver.received);
}

/// Without overflows, exactly the scans with samples in lost packets are missing.
RC_GTEST_PROP(LabjackU6Stream, LossesAreMinimal, ()) {
  const auto channels = *rc::gen::inRange<std::size_t>(1, 26);
  const auto samples = *rc::gen::inRange<std::size_t>(1, 26);
  std::mt19937 random(*rc::gen::arbitrary<std::uint32_t>());
  Board board(channels, samples);
  StreamDecoder decoder(static_cast<int>(channels), static_cast<int>(samples));
  Receiver receiver(channels);
  std::map<std::uint64_t, std::size_t> arrived;  // samples by scan
  for (int i = 0; i < 400; ++i) {
    const std::uint64_t first = board.scan() * channels + board.channel();
    const Bytes packet = board.packet();
    if (random() % 5 == 0) continue;
    for (std::size_t k = 0; k < samples; ++k) ++arrived[(first + k) / channels];
    RC_ASSERT(decoder.take(packet) == Outcome::ok);
    RC_ASSERT(receiver.receive(decoder));
  }
  std::uint64_t whole = 0;
  for (const auto& [scan, count] : arrived) whole += count == channels ? 1U : 0U;
  RC_ASSERT(receiver.received == whole);
}

/// Random bytes.
RC_GTEST_PROP(LabjackU6Stream, RandomBytesAreRejected, (const std::vector<std::uint8_t>& noise)) {
  StreamDecoder decoder(4, 25);
  RC_ASSERT(decoder.take(noise) == Outcome::damaged);
  RC_ASSERT(decoder.scans().empty());
}

}  // namespace
}  // namespace stickslip::drivers::labjack_u6
