// SPDX-License-Identifier: Apache-2.0
#include "daemon/ledger.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <chrono>
#include <thread>
#include <vector>

#include "daemon/stream.h"
#include "tests/unit/daemon/fakes.h"

namespace stickslip::daemon {
namespace {

using namespace std::chrono_literals;

Sample sample_of(std::uint64_t sequence) {
  Sample sample;
  sample.frame.sequence = sequence;
  return sample;
}

TEST(Ledger, BalancesIfEveryFrameHasAnEntry) {
  Ledger ledger;
  ledger.published().enable();
  ledger.recorded().enable();
  for (int i = 0; i < 10; ++i) ledger.produce();
  ledger.published().deliver(7);
  ledger.published().lose(Loss::ring_full, 1);
  ledger.published().lose(Loss::encode_error, 2);
  ledger.recorded().deliver(9);
  EXPECT_FALSE(ledger.balance().is_closed());
  EXPECT_EQ(ledger.balance().pending(ledger.balance().recorded), 1);
  EXPECT_THAT(ledger.balance().text(), testing::HasSubstr("1 unaccounted"));
  ledger.recorded().lose(Loss::write_error, 1);
  EXPECT_TRUE(ledger.balance().is_closed());
  EXPECT_EQ(ledger.balance().published.lost_in_total(), 3U);
  EXPECT_EQ(ledger.balance().text(),
            "publishing: 10 produced = 7 published + 1 lost (ring full) + 0 lost (write error) + 2 "
            "lost (encode error) + 0 lost (shutdown)\n"
            "recording: 10 produced = 9 recorded + 0 lost (ring full) + 1 lost (write error) + 0 "
            "lost (encode error) + 0 lost (shutdown)");
}

TEST(Ledger, DoesNotBalanceIfAFrameIsCountedTwice) {
  Ledger ledger;
  ledger.recorded().enable();
  ledger.produce();
  ledger.recorded().deliver(1);
  ledger.recorded().lose(Loss::shutdown, 1);
  EXPECT_FALSE(ledger.balance().is_closed());
  EXPECT_EQ(ledger.balance().pending(ledger.balance().recorded), -1);
}

TEST(Ledger, HasNoAccountForADisabledConsumer) {
  Ledger ledger;
  ledger.produce();
  EXPECT_TRUE(ledger.balance().is_closed());
  EXPECT_EQ(ledger.balance().text(), "publishing: off\nrecording: off");
}

TEST(Stream, DeliversEverythingInOrderInWholeBlocksAndTheRestAtTheEnd) {
  Ledger ledger;
  test::FakeSink sink;
  {
    Stream stream(sink, ledger.published(), {.frames_per_block = 10, .poll = 100us});
    stream.start();
    for (std::uint64_t i = 0; i < 1234; ++i) {
      ledger.produce();
      stream.offer(sample_of(i));
    }
    stream.finish(10s);
  }
  ASSERT_EQ(sink.samples.size(), 1234U);
  for (std::uint64_t i = 0; i < 1234; ++i) ASSERT_EQ(sink.samples[i].frame.sequence, i);
  for (std::size_t i = 0; i + 1 < sink.sizes.size(); ++i) ASSERT_EQ(sink.sizes[i], 10U);
  EXPECT_EQ(sink.sizes.back(), 4U);
  EXPECT_TRUE(ledger.balance().is_closed());
}

TEST(Stream, AFrameWaitsALimitedTimeForItsBlockToFill) {
  Ledger ledger;
  test::FakeSink sink;
  Stream stream(sink, ledger.published(),
                {.frames_per_block = 10, .poll = 1ms, .longest_wait = 20ms});
  stream.start();
  stream.offer(sample_of(0));
  for (int i = 0; i < 1000 && ledger.balance().published.delivered == 0; ++i) {
    std::this_thread::sleep_for(5ms);
  }
  EXPECT_EQ(ledger.balance().published.delivered, 1U);
}

TEST(Stream, ARefusalByTheFlushIsAWriteError) {
  Ledger ledger;
  test::FakeSink sink;
  // Refuses the first flush that has something to flush.
  sink.on_flush = [&sink, refused = false]() mutable {
    if (refused || sink.sizes.empty()) return true;
    refused = true;
    return false;
  };
  Stream stream(sink, ledger.recorded(),
                {.frames_per_block = 10, .poll = 100us, .flush_period = 1h});
  stream.start();
  for (std::uint64_t i = 0; i < 95; ++i) {
    ledger.produce();
    stream.offer(sample_of(i));
  }
  stream.finish(10s);
  const AccountBalance recorded = ledger.balance().recorded;
  EXPECT_TRUE(ledger.balance().is_closed());
  EXPECT_GT(recorded.lost_to(Loss::write_error), 0U);
  EXPECT_EQ(recorded.delivered + recorded.lost_to(Loss::write_error), 95U);
}

TEST(Stream, EstimatesFollowTheirBlockWithAnySequenceNumbers) {
  Ledger ledger;
  test::FakeSink sink;
  Stream stream(sink, ledger.published(), {.frames_per_block = 10, .poll = 100us});
  stream.start();
  for (std::uint64_t i = 0; i < 5000; ++i) {
    Sample sample = sample_of(i % 7 == 0 ? 1'000'000 : i % 100);
    sample.number = i;
    while (stream.full()) std::this_thread::sleep_for(100us);
    if (i % 10 == 9) {
      NumberedEstimate estimate{i, {}};
      estimate.estimate.mu = static_cast<double>(i);
      stream.offer(estimate);
    }
    stream.offer(sample);
  }
  stream.finish(10s);
  ASSERT_EQ(sink.estimates.size(), 500U);
  EXPECT_EQ(sink.estimates[0].mu, 9.0);
  EXPECT_EQ(sink.estimates.back().mu, 4999.0);
  EXPECT_EQ(stream.lost_messages(), 0U);
}

TEST(Stream, AFullRingLosesTheNewestAndReportsIt) {
  Ledger ledger;
  test::FakeSink sink;
  Stream stream(sink, ledger.recorded(), {.frames_per_block = 10, .ring_frames = 100, .poll = 1ms});
  for (std::uint64_t i = 0; i < 150; ++i) {
    ledger.produce();
    stream.offer(sample_of(i));
  }
  EXPECT_TRUE(stream.full());
  EXPECT_EQ(ledger.balance().recorded.lost_to(Loss::ring_full), 50U);
  stream.start();
  stream.finish(10s);
  ASSERT_EQ(sink.samples.size(), 100U);
  EXPECT_EQ(sink.samples.back().frame.sequence, 99U);
  EXPECT_TRUE(ledger.balance().is_closed());
}

TEST(Stream, MessagesArriveBeforeAndAfterTheEnd) {
  Ledger ledger;
  test::FakeSink sink;
  Stream stream(sink, ledger.published(), {.poll = 100us});
  stream.start();
  stream.send({"A", 1, {1}});
  stream.finish(10s);
  stream.send({"B", 2, {2}});
  ASSERT_EQ(sink.messages.size(), 2U);
  EXPECT_EQ(sink.messages[0].channel, "A");
  EXPECT_EQ(sink.messages[1].channel, "B");
}

TEST(Stream, FramesThatASlowSinkCannotTakeInTimeAreLostToShutdown) {
  Ledger ledger;
  test::FakeSink sink;
  sink.on_block = [](std::span<const Sample>) {
    std::this_thread::sleep_for(20ms);
    return WriteResult::ok;
  };
  Stream stream(sink, ledger.recorded(), {.frames_per_block = 10, .poll = 1ms});
  stream.start();
  for (std::uint64_t i = 0; i < 1000; ++i) {
    ledger.produce();
    stream.offer(sample_of(i));
  }
  stream.finish(100ms);
  const Balance balance = ledger.balance();
  EXPECT_GT(balance.recorded.lost_to(Loss::shutdown), 0U);
  EXPECT_GT(balance.recorded.delivered, 0U);
  EXPECT_TRUE(balance.is_closed()) << balance.text();
}

/// A sink that delays, refuses and fails to encode at random, and counts the frames it took.
class UnreliableConsumer {
 public:
  UnreliableConsumer() {
    sink.keep = false;
    const int stall = *rc::gen::inRange(0, 20);
    const int refuse = *rc::gen::inRange(0, 20);
    const int garble = *rc::gen::inRange(0, 20);
    std::uint64_t calls = *rc::gen::inRange<std::uint64_t>(0, 1000);
    sink.on_block = [this, stall, refuse, garble, calls](std::span<const Sample> block) mutable {
      const auto draw = static_cast<int>((++calls * 2654435761U >> 8U) % 100U);
      if (draw < stall) std::this_thread::sleep_for(300us);
      if (draw < refuse) {
        refused += block.size();
        return WriteResult::write_error;
      }
      if (draw < refuse + garble) {
        garbled += block.size();
        return WriteResult::encode_error;
      }
      taken += block.size();
      return WriteResult::ok;
    };
  }

  test::FakeSink sink;
  std::uint64_t taken = 0;
  std::uint64_t refused = 0;
  std::uint64_t garbled = 0;
};

StreamSettings with_small_ring(std::size_t frames_per_block) {
  return {.frames_per_block = frames_per_block,
          .ring_frames = *rc::gen::inRange<std::size_t>(1, 300),
          .poll = 50us};
}

void expect_nothing_negative(const Ledger& ledger) {
  const Balance balance = ledger.balance();
  RC_ASSERT(balance.pending(balance.published) >= 0);
  RC_ASSERT(balance.pending(balance.recorded) >= 0);
}

// With any behaviour of the consumers and any size of their rings, the ledger balances at the end,
// pending is never negative, and the sinks took what counts as delivered.
RC_GTEST_PROP(Ledger, BalancesUnderRandomStallsRefusalsAndFullRings, ()) {
  Ledger ledger;
  UnreliableConsumer publisher;
  UnreliableConsumer recorder;
  const auto frames_per_block = *rc::gen::inRange<std::size_t>(1, 17);
  Stream publishing(publisher.sink, ledger.published(), with_small_ring(frames_per_block));
  Stream recording(recorder.sink, ledger.recorded(), with_small_ring(frames_per_block));
  publishing.start();
  recording.start();
  const auto frames = *rc::gen::inRange<std::uint64_t>(0, 3000);
  const auto pause_every = *rc::gen::inRange<std::uint64_t>(50, 1000);
  for (std::uint64_t i = 0; i < frames; ++i) {
    ledger.produce();
    publishing.offer(sample_of(i));
    recording.offer(sample_of(i));
    if (i % pause_every == 0) std::this_thread::sleep_for(100us);
    if (i % 64 == 0) expect_nothing_negative(ledger);
  }
  const auto timeout = std::chrono::microseconds(*rc::gen::element(0, 200, 10'000'000));
  publishing.finish(timeout);
  recording.finish(timeout);

  const Balance balance = ledger.balance();
  RC_ASSERT(balance.is_closed());
  RC_ASSERT(balance.produced == frames);
  RC_ASSERT(balance.published.delivered == publisher.taken);
  RC_ASSERT(balance.recorded.delivered == recorder.taken);
  RC_ASSERT(balance.published.lost_to(Loss::write_error) == publisher.refused);
  RC_ASSERT(balance.recorded.lost_to(Loss::encode_error) == recorder.garbled);
}

}  // namespace
}  // namespace stickslip::daemon
