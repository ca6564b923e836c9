// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/wire.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <bit>
#include <cmath>
#include <limits>

#include "messages.h"

namespace stickslip::scope {
namespace {

using test::read_block;
using test::read_json;

TEST(Wire, HeadroomFitsTheHeader) { EXPECT_GE(Message::headroom, 16U); }

RC_GTEST_PROP(Wire, FramesArriveBitForBit, ()) {
  const auto count = *rc::gen::inRange<std::size_t>(1, 40);
  std::vector<Frame> frames;
  for (std::size_t i = 0; i < count; ++i) {
    Frame frame;
    frame.time_ns = *rc::gen::arbitrary<std::int64_t>();
    frame.sequence = *rc::gen::arbitrary<std::uint64_t>();
    for (const Channel channel : all_channels) {
      const double value = std::bit_cast<double>(*rc::gen::arbitrary<std::uint64_t>());
      if (std::isfinite(value) && *rc::gen::arbitrary<bool>()) frame.set(channel, value);
    }
    frames.push_back(frame);
  }
  const BlockNotes notes{*rc::gen::arbitrary<bool>(), *rc::gen::arbitrary<bool>(), 1.5e12};
  const auto message = encode_frames(frames, notes);
  RC_ASSERT(message.binary());
  RC_ASSERT(message.size() == block_header_bytes + count * frame_bytes);
  const auto block = read_block(message);
  RC_ASSERT(block.kind == 1);
  RC_ASSERT(block.channels == channel_count);
  RC_ASSERT(block.flags == ((notes.degraded ? 1U : 0U) | (notes.history ? 2U : 0U)));
  RC_ASSERT(block.received_unix_ms == notes.received_unix_ms);
  for (std::size_t i = 0; i < count; ++i) {
    RC_ASSERT(block.time_ns[i] == frames[i].time_ns);
    RC_ASSERT(block.sequence[i] == static_cast<std::int64_t>(frames[i].sequence));
    for (const Channel channel : all_channels) {
      const std::uint64_t bits = block.bits[index_of(channel)][i];
      if (frames[i].has(channel)) {
        RC_ASSERT(bits == std::bit_cast<std::uint64_t>(frames[i][channel]));
      } else {
        RC_ASSERT(std::isnan(std::bit_cast<double>(bits)));
      }
    }
  }
}

TEST(Wire, AnEstimateHasItsDeviationsByName) {
  friction_estimate_t estimate{};
  estimate.valid = 1;
  estimate.mu = 0.81;
  estimate.nis = std::numeric_limits<double>::infinity();
  estimate.state_count = 3;
  estimate.state_name = {"velocity_m_s", "load_cell_velocity_m_s", "mu"};
  estimate.state = {0.0, 0.0, 0.81};
  estimate.covariance = {{9.0, 1.0, 0.0}, {1.0, 4.0, 0.0}, {0.0, 0.0, 0.25}};
  const auto json = read_json(encode_estimate(estimate));
  EXPECT_EQ(json["type"], "estimate");
  EXPECT_EQ(json["valid"], true);
  EXPECT_EQ(json["mu"], 0.81);
  EXPECT_TRUE(json["nis"].is_null()) << "JSON has no infinity";
  EXPECT_EQ(json["deviation"]["mu"], 0.5);
  EXPECT_DOUBLE_EQ(json["deviation"]["slip_velocity_m_s"].get<double>(), std::sqrt(11.0));
  EXPECT_TRUE(json["deviation"]["theta"].is_null());
  EXPECT_EQ(json["innovation"].size(), 6U);
}

TEST(Wire, SlipOfARigidAttachmentHasTheDeviationOfTheMass) {
  friction_estimate_t estimate{};
  estimate.state_count = 1;
  estimate.state_name = {"velocity_m_s"};
  estimate.state = {0.0};
  estimate.covariance = {{9.0}};
  EXPECT_EQ(read_json(encode_estimate(estimate))["deviation"]["slip_velocity_m_s"], 3.0);
  estimate.covariance = {{-1.0}};
  EXPECT_TRUE(read_json(encode_estimate(estimate))["deviation"]["slip_velocity_m_s"].is_null());
}

TEST(Wire, AnExcitationHasItsFramesOldestFirst) {
  excitation_t message{};
  message.time_ns = 5'000'000;
  message.sequence = 5;
  message.drive = 0.5;
  message.phase_rad = 3.0;
  message.amplitude = 0.9;
  message.carrier_hz = 3.2;
  message.amplifier_on = 1;
  message.earlier = 2;
  message.earlier_by = {2, 1};
  message.earlier_drive = {0.25, 0.375};
  message.earlier_phase_rad = {1.0F, 2.0F};
  message.earlier_amplitude = {0.5F, 0.75F};
  message.earlier_state = {0, 0};
  const std::vector<std::optional<std::int64_t>> times = {3'000'000, 4'000'000};
  const auto json = read_json(encode_excitation(message, times));
  EXPECT_EQ(json["time_ns"], nlohmann::json({3'000'000, 4'000'000, 5'000'000}));
  EXPECT_EQ(json["drive"], nlohmann::json({0.25, 0.375, 0.5}));
  EXPECT_EQ(json["phase_rad"], nlohmann::json({1.0, 2.0, 3.0}));
  EXPECT_EQ(json["amplitude"], nlohmann::json({0.5, 0.75, 0.9}));
  EXPECT_EQ(json["amplifier_on"], true);

  const std::vector<std::optional<std::int64_t>> unknown = {std::nullopt, 4'000'000};
  const auto shorter = read_json(encode_excitation(message, unknown));
  EXPECT_EQ(shorter["time_ns"], nlohmann::json({4'000'000, 5'000'000}));
  EXPECT_EQ(shorter["drive"], nlohmann::json({0.375, 0.5}));
}

TEST(Wire, AStatusHasItsLossesByName) {
  status_t status{};
  status.state = "running";
  status.publish_loss_count = 1;
  status.publish_loss_name = {"ring full"};
  status.publish_loss = {7};
  status.record_confirmed = -1;
  const auto json = read_json(encode_status(status));
  EXPECT_EQ(json["state"], "running");
  EXPECT_EQ(json["publish_loss"], nlohmann::json({{"ring full", 7}}));
  EXPECT_EQ(json["record_loss"], nlohmann::json::object());
  EXPECT_EQ(json["record_confirmed"], -1);
  EXPECT_EQ(json["amplifier_on"], false);
}

TEST(Wire, InvalidUtf8YieldsValidJson) {
  event_t event{};
  event.code = "odd";
  event.message = "\xff\xfe \"quoted\"\n";
  event.severity = 2;
  const auto message = encode_event(event);
  const auto json = read_json(message);
  EXPECT_EQ(json["severity"], 2);
  EXPECT_NE(json["message"].get<std::string>().find("\"quoted\""), std::string::npos);
  EXPECT_EQ(message.keep(), Keep::always);
}

TEST(Wire, MarksAreTheDeclaredFrequencies) {
  physics::Model model;
  EXPECT_TRUE(marks_of(model).empty());
  model.oscillator.mass_kg = {0.5, 0.0};
  model.oscillator.stiffness_n_m = physics::Parameter{2.0, 0.0};
  ASSERT_EQ(marks_of(model).size(), 1U);
  EXPECT_NEAR(marks_of(model)[0].hz, 2.0 / (2.0 * std::numbers::pi), 1e-12);
  model.oscillator.stiffness_n_m.reset();
  model.oscillator.natural_frequency_hz = physics::Parameter{2.4, 0.0};
  model.load_cell = physics::LoadCell{};
  model.load_cell->natural_frequency_hz = {19.3, 0.0};
  physics::Term mode;
  mode.id = "second_mode";
  mode.parameters["frequency_hz"] = {37.0, 0.0};
  model.terms = {mode};
  EXPECT_EQ(
      marks_of(model),
      (std::vector<Mark>{{"natural frequency", 2.4}, {"load cell", 19.3}, {"bending mode", 37.0}}));
}

}  // namespace
}  // namespace stickslip::scope
