// SPDX-License-Identifier: Apache-2.0
#include "daemon/messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <chrono>
#include <cmath>
#include <limits>
#include <stickslip/event_t.hpp>
#include <stickslip/recording_info_t.hpp>
#include <stickslip/status_t.hpp>

#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"

namespace stickslip::daemon {
namespace {

struct Caught {
  std::string channel;
  std::vector<std::uint8_t> bytes;
  std::int64_t time_us;
};

class FakeWriter final : public MessageWriter {
 public:
  bool write(const std::string& channel, std::span<const std::uint8_t> bytes,
             std::int64_t time_us) override {
    if (channel == refused) return false;
    caught.push_back({channel, {bytes.begin(), bytes.end()}, time_us});
    return true;
  }
  std::vector<Caught> caught;
  std::string refused;
};

template <class Type>
Type decoded(const std::vector<std::uint8_t>& bytes) {
  Type out{};
  EXPECT_EQ(out.decode(bytes.data(), 0, static_cast<int>(bytes.size())),
            static_cast<int>(bytes.size()));
  return out;
}

std::vector<Sample> block_of(std::size_t frames) {
  std::vector<Sample> out(frames);
  for (std::size_t i = 0; i < frames; ++i) {
    Frame& frame = out[i].frame;
    frame.time_ns = static_cast<std::int64_t>(5'000'000'000 + i * 1'000'000 + 1);
    frame.sequence = 100 + i;
    frame.set(Channel::displacement, -0.0);
    frame.set(Channel::base_displacement, 1.0 / (3.0 + static_cast<double>(i)));
    if (i % 2 == 0) frame.set(Channel::normal_load, std::numeric_limits<double>::denorm_min());
  }
  return out;
}

TEST(Messages, FramesPassBitIdenticallyTogetherWithTheDrive) {
  FakeWriter writer;
  MessageSink sink(writer);
  std::vector<Sample> block = block_of(7);
  block.back().drive = {0.003, 0.008, 2.5, 0.25, 0.0};
  block.back().amplifier_on = true;
  EXPECT_EQ(sink.write_block(block), WriteResult::ok);
  ASSERT_EQ(writer.caught.size(), 2U);

  EXPECT_EQ(writer.caught[0].channel, protocol::frames_channel);
  std::vector<Frame> frames;
  const auto message = decoded<frame_block_t>(writer.caught[0].bytes);
  ASSERT_TRUE(protocol::from_block(message, frames));
  EXPECT_EQ(message.flags, 0);
  ASSERT_EQ(frames.size(), 7U);
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(frames[i], block[i].frame);
    EXPECT_TRUE(std::signbit(frames[i][Channel::displacement]));
  }

  EXPECT_EQ(writer.caught[1].channel, protocol::excitation_channel);
  const auto excitation = decoded<excitation_t>(writer.caught[1].bytes);
  EXPECT_EQ(excitation.sequence, 106);
  EXPECT_EQ(excitation.drive, 0.003);
  EXPECT_EQ(excitation.carrier_hz, 2.5);
  EXPECT_DOUBLE_EQ(excitation.phase_rad, M_PI / 2.0);
  EXPECT_EQ(excitation.amplifier_on, 1);
  EXPECT_EQ(excitation.earlier_by, (std::vector<std::int32_t>{6, 5, 4, 3, 2, 1}));
}

TEST(Messages, TheDriveAtEveryFrameIsPublishedEveryTenthOfASecondAndAtTheEnd) {
  FakeWriter writer;
  MessageSink sink(writer);
  std::vector<double> asked;
  std::uint64_t sequence = 50;
  for (int block = 0; block < 25; ++block) {
    std::vector<Sample> samples(10);
    for (Sample& sample : samples) {
      sequence += asked.size() % 7 == 3 ? 5 : 1;  // the source loses some frames
      sample.frame.sequence = sequence;
      sample.frame.time_ns = static_cast<std::int64_t>(asked.size()) * 1'000'000;
      sample.drive.value = std::sin(0.1 * static_cast<double>(asked.size()));
      sample.drive.amplitude = 0.5;
      sample.drive.phase_turns = 0.75;
      sample.drive.limited = asked.size() % 2 == 0 ? Limit::velocity : Limit::none;
      sample.amplifier_on = asked.size() >= 100;
      asked.push_back(sample.drive.value);
    }
    ASSERT_EQ(sink.write_block(samples), WriteResult::ok);
  }
  sink.finish();

  std::vector<excitation_t> messages;
  for (const Caught& caught : writer.caught) {
    if (caught.channel != protocol::excitation_channel) continue;
    excitation_t message{};
    ASSERT_TRUE(protocol::decode(caught.bytes, message));
    messages.push_back(message);
  }
  ASSERT_EQ(messages.size(), 4U);  // first block, 0.1 s and 0.2 s later, end
  std::vector<double> published;
  std::int64_t latest = 50;
  for (const excitation_t& message : messages) {
    for (std::size_t i = 0; i < message.earlier_by.size(); ++i) {
      EXPECT_GT(message.sequence - message.earlier_by[i], latest);
      latest = message.sequence - message.earlier_by[i];
      EXPECT_EQ(message.earlier_amplitude[i], 0.5F);
      EXPECT_FLOAT_EQ(message.earlier_phase_rad[i], static_cast<float>(1.5 * M_PI));
      EXPECT_EQ(message.earlier_state[i],
                (published.size() % 2 == 0 ? static_cast<int>(Limit::velocity) : 0) |
                    (published.size() >= 100 ? 0x80 : 0));
      published.push_back(message.earlier_drive[i]);
    }
    published.push_back(message.drive);
    latest = message.sequence;
  }
  EXPECT_EQ(published, asked);
  EXPECT_EQ(latest, static_cast<std::int64_t>(sequence));
}

TEST(Messages, RefusedFramesHaveNoDriveToPublish) {
  FakeWriter writer;
  MessageSink sink(writer);
  writer.refused = protocol::frames_channel;
  EXPECT_EQ(sink.write_block(block_of(3)), WriteResult::write_error);
  sink.finish();
  EXPECT_TRUE(writer.caught.empty());
}

TEST(Messages, ALateCycleMarksItsBlock) {
  FakeWriter writer;
  MessageSink sink(writer);
  std::vector<Sample> block = block_of(3);
  block[1].late = true;
  sink.write_block(block);
  EXPECT_EQ(decoded<frame_block_t>(writer.caught[0].bytes).flags, 1);
}

TEST(Messages, LogTimeRunsWithRigTimeFromTheWallClock) {
  FakeWriter writer;
  MessageSink sink(writer);
  const auto now_us = std::chrono::duration_cast<std::chrono::microseconds>(
                          std::chrono::system_clock::now().time_since_epoch())
                          .count();
  std::vector<Sample> block = block_of(1);
  sink.write_block(block);
  block[0].frame.time_ns += 3'600'000'000'000;
  sink.write_block(block);
  EXPECT_NEAR(static_cast<double>(writer.caught[0].time_us - now_us), 0.0, 60e6);
  EXPECT_EQ(writer.caught[2].time_us - writer.caught[0].time_us, 3'600'000'000);
}

TEST(Messages, ARefusedBlockIsAWriteError) {
  FakeWriter writer;
  writer.refused = protocol::frames_channel;
  MessageSink sink(writer);
  EXPECT_EQ(sink.write_block(block_of(2)), WriteResult::write_error);
}

TEST(Messages, AnEstimateCarriesItsCovarianceByName) {
  FakeWriter writer;
  MessageSink sink(writer);
  Estimate estimate;
  estimate.time_ns = 42;
  estimate.sequence = 7;
  estimate.status = observer::EstimateStatus::good;
  estimate.valid = true;
  estimate.mu = 0.8;
  estimate.theta = -0.5;
  estimate.used = 3;
  estimate.quantities = {observer::Quantity::load_cell_deflection, observer::Quantity::theta,
                         observer::Quantity::mu};
  estimate.covariance[1][1] = 0.01;
  estimate.covariance[1][2] = estimate.covariance[2][1] = 0.002;
  estimate.covariance[2][2] = 0.04;
  estimate.innovation[0] = 1e-5;
  estimate.innovation_std[0] = 2e-5;
  estimate.innovation[1] = 1.0;  // not used
  estimate.innovation_valid = 1;
  estimate.nis_mean = 1.25;
  estimate.nis_mean_low = 0.5;
  estimate.nis_mean_high = 1.5;
  estimate.whiteness[5] = -0.25;
  estimate.whiteness_bound[2] = 0.125;
  EXPECT_EQ(sink.write_estimate(estimate), WriteResult::ok);
  const auto out = decoded<friction_estimate_t>(writer.caught.at(0).bytes);
  EXPECT_EQ(out.sequence, 7);
  EXPECT_EQ(out.valid, 1);
  EXPECT_EQ(out.mu, 0.8);
  EXPECT_THAT(out.state_name, testing::ElementsAre("theta", "mu"));
  EXPECT_THAT(out.state, testing::ElementsAre(-0.5, 0.8));
  EXPECT_THAT(out.covariance, testing::ElementsAre(testing::ElementsAre(0.01, 0.002),
                                                   testing::ElementsAre(0.002, 0.04)));
  EXPECT_DOUBLE_EQ(out.innovation_variance[0], 4e-10);
  EXPECT_EQ(out.innovation[1], 0.0);
  EXPECT_EQ(out.nis_mean, 1.25);
  EXPECT_EQ(out.nis_mean_low, 0.5);
  EXPECT_EQ(out.nis_mean_high, 1.5);
  EXPECT_EQ(out.whiteness[5], -0.25);
  EXPECT_EQ(out.whiteness_bound[2], 0.125);

  // The next one is empty and keeps nothing of the previous one.
  EXPECT_EQ(sink.write_estimate(Estimate{}), WriteResult::ok);
  const auto none = decoded<friction_estimate_t>(writer.caught.at(1).bytes);
  EXPECT_EQ(none.valid, 0);
  EXPECT_EQ(none.state_count, 0);
}

TEST(Messages, StatusHoldsTheWholeLedger) {
  Status status;
  status.state = RigState::stopping;
  status.ledger.produced = 100;
  status.ledger.recorded.enabled = true;
  status.ledger.recorded.delivered = 90;
  status.ledger.recorded.lost = {1, 2, 3, 4};
  status.ledger.recorded.confirmed = 80;
  status.overruns = 5;
  const Message message = status_message(status, 1'700'000'000'000'000);
  EXPECT_EQ(message.channel, protocol::status_channel);
  const auto out = decoded<status_t>(message.bytes);
  EXPECT_EQ(out.state, "stopping");
  EXPECT_EQ(out.produced, 100);
  EXPECT_EQ(out.publishing, 0);
  EXPECT_EQ(out.recording, 1);
  EXPECT_EQ(out.recorded, 90);
  EXPECT_EQ(out.record_confirmed, 80);
  EXPECT_EQ(decoded<status_t>(status_message(Status{}, 1).bytes).record_confirmed, -1);
  EXPECT_THAT(out.record_loss, testing::ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(out.record_loss_name,
              testing::ElementsAre("ring full", "write error", "encode error", "shutdown"));
  EXPECT_EQ(out.overruns, 5);
}

TEST(Messages, EventsAndTheDescriptionOfTheRecording) {
  Notice notice;
  notice.kind = Notice::Kind::fault;
  notice.sequence = 9;
  notice.set_text("cable pulled");
  const auto event = decoded<event_t>(event_message(event_of(notice), 1).bytes);
  EXPECT_EQ(event.severity, 2);
  EXPECT_EQ(event.code, "fault");
  EXPECT_EQ(event.message, "amplifier off: cable pulled");
  EXPECT_EQ(event.sequence, 9);

  config::Rig rig;
  rig.name = "beam";
  rig.text = "[rig]\n";
  rig.model_text = "schema = 1\n";
  const auto info = decoded<recording_info_t>(recording_info_message(rig, 77).bytes);
  EXPECT_EQ(info.schema, 3);
  EXPECT_EQ(info.fault_script, "");
  EXPECT_EQ(info.fault_script_sha256, "");
  EXPECT_EQ(info.model_sha256.size(), 64U);
  EXPECT_EQ(info.calibration_sha256, "");
  EXPECT_EQ(info.part, 0);
  EXPECT_EQ(info.started_utc_us, 77);
  EXPECT_EQ(info.rig, "beam");
  EXPECT_EQ(info.configuration, "[rig]\n");
  EXPECT_EQ(info.model, "schema = 1\n");
  EXPECT_EQ(info.program, "stickslipd");

  rig.faults = config::FaultScript{"faults.toml", "schema = 1\n", 1, {}};
  const auto faulty = decoded<recording_info_t>(recording_info_message(rig, 77).bytes);
  EXPECT_EQ(faulty.fault_script, "schema = 1\n");
  EXPECT_EQ(faulty.fault_script_sha256.size(), 64U);
}

TEST(Events, EveryNoticeHasAMessageAndLongTextIsTruncated) {
  for (int kind = 0; kind <= static_cast<int>(Notice::Kind::estimate_restarted); ++kind) {
    Notice notice;
    notice.kind = static_cast<Notice::Kind>(kind);
    EXPECT_FALSE(event_of(notice).code.empty());
    EXPECT_FALSE(event_of(notice).message.empty());
  }
  Notice overrun;
  overrun.kind = Notice::Kind::overrun;
  overrun.count = 4;
  overrun.duration_ns = 4'050'000;
  EXPECT_EQ(event_of(overrun).message, "a cycle was 4.050 ms late, 4 periods skipped");
  Notice longer;
  longer.set_text(std::string(1000, 'x'));
  EXPECT_EQ(std::string(longer.text.data()).size(), longer.text.size() - 1);
}

}  // namespace
}  // namespace stickslip::daemon
