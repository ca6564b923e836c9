// SPDX-License-Identifier: Apache-2.0
#include "drivers/usb_1208fs_plus/protocol.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

namespace stickslip::drivers::usb_1208fs_plus {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;

std::vector<std::uint8_t> memory_of(float slope, float offset) {
  std::vector<std::uint8_t> bytes(calibration_bytes);
  for (std::size_t at = 0; at < bytes.size(); at += 8) {
    std::memcpy(&bytes[at], &slope, 4);
    std::memcpy(&bytes[at + 4], &offset, 4);
  }
  return bytes;
}

config::BenchInputs inputs_of(std::vector<config::BenchInput> given) {
  config::BenchInputs inputs;
  for (std::size_t i = 0; i < given.size(); ++i) inputs[i] = given[i];
  return inputs;
}

config::BenchInput single_ended(std::string input) {
  return {"usb_1208fs_plus", input, 10.0, false, 1};
}
config::BenchInput differential(std::string input, double range_v) {
  return {"usb_1208fs_plus", input, range_v, true, 1};
}

std::string refusal_of(const config::BenchInputs& inputs, double rate_hz = 1000.0,
                       const config::ReadbackInputs& outputs = {}) {
  std::string refusal;
  EXPECT_FALSE(plan_scan(inputs, outputs, rate_hz, refusal).has_value());
  return refusal;
}

TEST(Usb1208fsPlusInput, IsCorrectedAndScaledByTheRange) {
  EXPECT_EQ(input_volts(2048, 10.0, {}), 0.0);
  EXPECT_EQ(input_volts(0, 10.0, {}), -10.0);
  EXPECT_EQ(input_volts(3072, 5.0, {}), 2.5);
  EXPECT_NEAR(input_volts(2000, 10.0, {1.01F, 28.0F}), 0.0, 1e-4);
}

TEST(Usb1208fsPlusOutput, IsLimitedToItsRange) {
  EXPECT_EQ(output_counts(2.5), 2048);
  EXPECT_EQ(output_counts(0.0), 0);
  EXPECT_EQ(output_counts(-1.0), 0);
  EXPECT_EQ(output_counts(5.0), 4095);
  EXPECT_EQ(output_counts(1e300), 4095);
  EXPECT_EQ(output_counts(std::numeric_limits<double>::quiet_NaN()), 0);
}

TEST(Usb1208fsPlusCalibration, IsParsedFromMemory) {
  auto memory = memory_of(1.0F, 0.0F);
  const float slope = 1.02F;
  const float offset = -7.5F;
  std::memcpy(&memory[8 * (4 * 2 + 3)], &slope, 4);     // differential, +-5 V, CH3
  std::memcpy(&memory[0x100 + 8 * 6 + 4], &offset, 4);  // single-ended, CH6
  const auto calibration = parse_calibration(memory);
  ASSERT_TRUE(calibration);
  EXPECT_EQ(calibration->differential[2][3].slope, slope);
  EXPECT_EQ(calibration->single_ended[6].offset, offset);
  EXPECT_EQ(calibration->single_ended[5].offset, 0.0F);
}

TEST(Usb1208fsPlusCalibration, ErasedMemoryIsRejected) {
  EXPECT_FALSE(parse_calibration(std::vector<std::uint8_t>(calibration_bytes, 0xFF)));
  EXPECT_FALSE(parse_calibration(std::vector<std::uint8_t>(calibration_bytes, 0x00)));
  EXPECT_FALSE(parse_calibration(memory_of(1.0F, 600.0F)));
  EXPECT_FALSE(parse_calibration(std::vector<std::uint8_t>(calibration_bytes - 1)));
  EXPECT_TRUE(parse_calibration(memory_of(0.99F, 12.0F)));
}

TEST(Usb1208fsPlusStatus, DecodesItsBits) {
  const Status status = status_of(0x0002 | 0x0010);
  EXPECT_TRUE(status.input_running);
  EXPECT_FALSE(status.input_overrun);
  EXPECT_FALSE(status.output_running);
  EXPECT_TRUE(status.output_underrun);
}

TEST(Usb1208fsPlusPlan, FiveInputsAtAKilohertzAreEncoded) {
  std::string refusal;
  const auto plan =
      plan_scan(inputs_of({single_ended("CH4"), single_ended("CH0"), single_ended("CH2"),
                           single_ended("CH1"), single_ended("CH3")}),
                {}, 1000.0, refusal);
  ASSERT_TRUE(plan) << refusal;
  ASSERT_EQ(plan->channels.size(), 5U);
  EXPECT_EQ(plan->channels[0].frame_index, 1U);
  EXPECT_EQ(plan->channels[4].frame_index, 0U);
  EXPECT_EQ(plan->period_s, 1e-3);
  EXPECT_EQ(plan->conversion_s(), 0.2e-3);
  EXPECT_FALSE(plan->immediate);
  EXPECT_EQ(plan->transfer_bytes, 64U);
  // 60 MHz / 5000 - 1 = 11999 = 0x2EDF
  EXPECT_THAT(input_scan(*plan), ElementsAre(0, 0, 0, 0, 0, 0, 0, 0, 0xDF, 0x2E, 0, 0, 0x1F, 0));
  // 60 MHz / 1000 - 1 = 59999 = 0xEA5F: one value each scan.
  EXPECT_THAT(output_scan(*plan, 1), ElementsAre(0, 0, 0, 0, 0x5F, 0xEA, 0, 0, 2));
  EXPECT_THAT(input_ranges(*plan), Each(0));
}

TEST(Usb1208fsPlusPlan, DifferentialInputsHaveRanges) {
  std::string refusal;
  const auto plan =
      plan_scan(inputs_of({differential("CH1", 2.5), differential("CH3", 1.0)}), {}, 50.0, refusal);
  ASSERT_TRUE(plan) << refusal;
  EXPECT_TRUE(plan->immediate);
  EXPECT_EQ(plan->channels.size(), 2U);
  EXPECT_EQ(input_scan(*plan)[12], 0x0A);
  EXPECT_EQ(input_scan(*plan)[13], 0x03);
  EXPECT_THAT(input_ranges(*plan), ElementsAre(0, 4, 0, 7, 0, 0, 0, 0));
}

TEST(Usb1208fsPlusPlan, FewInputsArePaddedToFillPacketsInTime) {
  std::string refusal;
  const auto plan = plan_scan(inputs_of({single_ended("CH2")}), {}, 1000.0, refusal);
  ASSERT_TRUE(plan) << refusal;
  ASSERT_EQ(plan->channels.size(), 4U);  // 32 samples in 8 ms
  EXPECT_EQ(plan->channels[2].frame_index, 0U);
  EXPECT_FALSE(plan->channels[0].frame_index.has_value());
  EXPECT_EQ(plan->period_s, 1e-3);
}

TEST(Usb1208fsPlusPlan, InputsThatReadOutputsBackAreScannedButNoChannels) {
  std::string refusal;
  const config::ReadbackInputs outputs{single_ended("CH0"), single_ended("CH7")};
  const auto plan = plan_scan(inputs_of({single_ended("CH3")}), outputs, 1000.0, refusal);
  ASSERT_TRUE(plan) << refusal;
  ASSERT_EQ(plan->channels.size(), 4U);  // one more to fill packets, beside those in use
  EXPECT_EQ(plan->channels[0].output, &OutputReadings::drive_v);
  EXPECT_FALSE(plan->channels[0].frame_index.has_value());
  EXPECT_EQ(plan->channels[1].output, nullptr);
  EXPECT_FALSE(plan->channels[1].frame_index.has_value());
  EXPECT_EQ(plan->channels[2].frame_index, 0U);
  EXPECT_EQ(plan->channels[2].output, nullptr);
  EXPECT_EQ(plan->channels[3].output, &OutputReadings::enable_v);
  EXPECT_EQ(input_scan(*plan)[12], 0x8B);
}

TEST(Usb1208fsPlusPlan, ReportsInvalidReadbacks) {
  const config::BenchInputs one = inputs_of({single_ended("CH0")});
  EXPECT_THAT(refusal_of(one, 1000.0, {single_ended("CH0"), {}}), HasSubstr("assigned twice"));
  EXPECT_THAT(refusal_of(one, 1000.0, {{}, differential("CH1", 10.0)}),
              HasSubstr("all single-ended or all differential"));
  EXPECT_THAT(refusal_of(one, 1000.0, {single_ended("CH9"), {}}),
              HasSubstr("the input CH9 for readback.drive does not exist"));
  EXPECT_THAT(refusal_of({}, 1000.0, {single_ended("CH1"), {}}),
              HasSubstr("no channel is assigned"));
}

TEST(Usb1208fsPlusPlan, ReportsInvalidConfigurations) {
  EXPECT_THAT(refusal_of({}), HasSubstr("no channel is assigned to its inputs"));
  EXPECT_THAT(refusal_of(inputs_of({single_ended("CH8")})),
              HasSubstr("the input CH8 for displacement does not exist; inputs are CH0 to CH7"));
  EXPECT_THAT(refusal_of(inputs_of({differential("CH4", 1.0)})), HasSubstr("CH0 to CH3"));
  EXPECT_THAT(refusal_of(inputs_of({differential("CH0", 3.0)})),
              HasSubstr("a range of 3 V; a differential input of this board has 20, 10"));
  EXPECT_THAT(refusal_of(inputs_of({{"usb_1208fs_plus", "CH0", 5.0, false, 1}})),
              HasSubstr("a single-ended input of this board has 10 V"));
  EXPECT_THAT(refusal_of(inputs_of({single_ended("CH0"), differential("CH1", 1.0)})),
              HasSubstr("all single-ended or all differential"));
  EXPECT_THAT(refusal_of(inputs_of({single_ended("CH0"), single_ended("CH0")})),
              HasSubstr("CH0 is assigned twice"));
  EXPECT_THAT(refusal_of(inputs_of({single_ended("CH0")}), 60000.0), HasSubstr("at most 51200"));
  EXPECT_THAT(refusal_of(inputs_of({single_ended("CH0")}), std::nan("")), HasSubstr("1 Hz"));
}

RC_GTEST_PROP(Usb1208fsPlusScan, IsIndependentOfPacketBoundaries, ()) {
  const auto channels = *rc::gen::inRange<std::size_t>(1, 9);
  const auto codes =
      *rc::gen::container<std::vector<std::uint16_t>>(rc::gen::inRange<std::uint16_t>(0, 4096));
  std::vector<std::uint8_t> bytes;
  for (const std::uint16_t code : codes) {
    bytes.push_back(static_cast<std::uint8_t>(code));
    bytes.push_back(static_cast<std::uint8_t>(code >> 8U));
  }
  ScanDecoder decoder(channels);
  std::vector<std::uint16_t> decoded;
  std::span<const std::uint8_t> left(bytes);
  while (!left.empty()) {
    const auto size = *rc::gen::inRange<std::size_t>(1, 65);
    auto packet = left.first(std::min(size, left.size()));
    left = left.subspan(packet.size());
    while (!packet.empty()) {
      if (const auto scan = decoder.next(packet)) {
        RC_ASSERT(scan->size() == channels);
        decoded.insert(decoded.end(), scan->begin(), scan->end());
      }
    }
  }
  const std::size_t whole = codes.size() / channels * channels;
  RC_ASSERT(decoded == std::vector<std::uint16_t>(
                           codes.begin(), codes.begin() + static_cast<std::ptrdiff_t>(whole)));
}

RC_GTEST_PROP(Usb1208fsPlusPlan, KeepsScanAndOutputRates, ()) {
  const auto count = *rc::gen::inRange<std::size_t>(1, 7);
  const auto rate_hz = *rc::gen::inRange<int>(1, 51200 / static_cast<int>(count));
  std::vector<config::BenchInput> given;
  for (std::size_t i = 0; i < count; ++i) given.push_back(single_ended("CH" + std::to_string(i)));
  std::string refusal;
  const auto plan = plan_scan(inputs_of(given), {}, rate_hz, refusal);
  RC_ASSERT(plan.has_value());
  // Half a tick of 60 MHz per conversion.
  RC_ASSERT(std::abs(plan->period_s - 1.0 / rate_hz) <=
            0.51 * static_cast<double>(plan->channels.size()) / 60e6);
  RC_ASSERT((plan->input_pacer + 1) * plan->channels.size() == plan->output_pacer + 1);
  RC_ASSERT(plan->transfer_bytes % 64 == 0 && plan->transfer_bytes > 0);
}

}  // namespace
}  // namespace stickslip::drivers::usb_1208fs_plus
