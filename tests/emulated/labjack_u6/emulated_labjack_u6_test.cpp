// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/labjack_u6/emulated_labjack_u6.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

namespace stickslip::emulated {
namespace {

using testing::ElementsAre;

constexpr std::int64_t ms = 1'000'000;

class TestWires final : public Wires {
 public:
  double truth(Channel channel, std::int64_t time_ns) override {
    const double time_s = static_cast<double>(time_ns) * 1e-9;
    return channel == Channel::displacement ? std::sin(6.0 * time_s) : 2.0;
  }
  void drive(double volts, std::int64_t time_ns) override { driven.push_back({volts, time_ns}); }
  void enable(bool on, std::int64_t time_ns) override { enabled.push_back({on, time_ns}); }
  bool amplifier_fault() const override { return fault; }
  bool emergency_stop() const override { return pressed; }

  std::vector<std::pair<double, std::int64_t>> driven;
  std::vector<std::pair<bool, std::int64_t>> enabled;
  bool fault = false;
  bool pressed = false;
};

// The checksums again, from the documentation and not from the emulation.
unsigned sum_of(const Bytes& bytes, std::size_t first, std::size_t last) {
  return std::accumulate(bytes.begin() + static_cast<std::ptrdiff_t>(first),
                         bytes.begin() + static_cast<std::ptrdiff_t>(last), 0U);
}

std::uint8_t folded(unsigned sum) {
  for (int i = 0; i < 2; ++i) sum = sum / 256 + sum % 256;
  return static_cast<std::uint8_t>(sum);
}

Bytes extended(std::uint8_t command, Bytes data) {
  if (data.size() % 2 != 0) data.push_back(0);
  Bytes bytes = {0, 0xF8, static_cast<std::uint8_t>(data.size() / 2), command, 0, 0};
  bytes.insert(bytes.end(), data.begin(), data.end());
  const unsigned sum = sum_of(bytes, 6, bytes.size());
  bytes[4] = static_cast<std::uint8_t>(sum);
  bytes[5] = static_cast<std::uint8_t>(sum >> 8U);
  bytes[0] = folded(sum_of(bytes, 1, 6));
  return bytes;
}

void expect_valid(const Bytes& bytes) {
  ASSERT_GE(bytes.size(), 8U);
  EXPECT_EQ(bytes.size(), 6U + 2U * bytes[2]);
  EXPECT_EQ(bytes[0], folded(sum_of(bytes, 1, 6)));
  EXPECT_EQ(bytes[4] + 256U * bytes[5], sum_of(bytes, 6, bytes.size()));
}

struct EmulatedU6 : testing::Test {
  std::int64_t now_ns = 0;
  TestWires wires;
  EmulatedLabjackU6 u6{wires, [this] { return now_ns; }, options()};

  static LabjackU6Options options() {
    LabjackU6Options options;
    options.noise = 0.0;
    options.enable_line = 2;
    options.amplifier_fault_line = 3;
    options.emergency_stop_line = 4;
    return options;
  }

  EmulatedU6() {
    u6.reset();
    u6.wire(0, {Channel::displacement, 3.0, 0.5});
    u6.wire(2, {Channel::velocity, -1.0, 0.0});  // -2 V
    u6.wire(3, {Channel::velocity, 0.01, 0.0});  // 0.02 V
  }

  Bytes request(const Bytes& command) {
    EXPECT_EQ(u6.out(1, command), UsbStatus::ok);
    const UsbAnswer answer = u6.in(2, 64);
    EXPECT_EQ(answer.status, UsbStatus::ok);
    return answer.bytes;
  }
  Bytes feedback(Bytes io_types) {
    io_types.insert(io_types.begin(), 0x77);
    return request(extended(0x00, std::move(io_types)));
  }
  double constant(unsigned index) {
    const Bytes block = request(extended(0x2D, {0, static_cast<std::uint8_t>(index / 4)}));
    std::uint64_t fixed = 0;
    for (unsigned i = 8; i-- > 0;) fixed = fixed * 256 + block[8 + 8 * (index % 4) + i];
    return static_cast<double>(static_cast<std::int64_t>(fixed)) / 4294967296.0;
  }
  /// 1 kHz of AIN0, differential AIN2 and AIN3.
  void start(std::uint8_t samples_per_packet = 25, std::uint16_t interval = 4000) {
    EXPECT_EQ(request(extended(
                  0x11, {3, 0, samples_per_packet, 0, 0, 0, static_cast<std::uint8_t>(interval),
                         static_cast<std::uint8_t>(interval >> 8U), 0, 0, 2, 0x80, 3, 0x20}))[6],
              0);
    EXPECT_THAT(request({0xA8, 0xA8}), ElementsAre(0xA9, 0xA9, 0, 0));
  }
  std::vector<Bytes> packets() {
    std::vector<Bytes> out;
    while (true) {
      const UsbAnswer answer = u6.in(3, 64);
      if (answer.status != UsbStatus::ok) return out;
      out.push_back(answer.bytes);
    }
  }
};

TEST_F(EmulatedU6, IdentifiesItself) {
  const Bytes device = u6.device_descriptor();
  ASSERT_EQ(device.size(), 18U);
  EXPECT_EQ(device[8] + 256 * device[9], 0x0CD5);
  EXPECT_EQ(device[10] + 256 * device[11], 6);
  const Bytes configuration = u6.configuration_descriptor();
  EXPECT_EQ(configuration.size(), 9U + 9U + 3U * 7U);
  EXPECT_EQ(configuration[2], configuration.size());
  const Bytes reply = request(extended(0x08, Bytes(20)));
  expect_valid(reply);
  ASSERT_EQ(reply.size(), 38U);
  EXPECT_EQ(reply[6], 0);
  EXPECT_EQ(reply[9], 43);
  EXPECT_EQ(reply[10], 1);
  EXPECT_EQ(reply[15] + 256U * reply[16] + 65536U * reply[17] + 16777216U * reply[18], 360009876U);
  EXPECT_EQ(reply[19], 6);
  EXPECT_EQ(reply[37], 4);
}

TEST_F(EmulatedU6, RejectsWrongChecksumsWithB8B8) {
  Bytes command = extended(0x08, Bytes(20));
  command[0] ^= 1;
  EXPECT_THAT(request(command), ElementsAre(0xB8, 0xB8));
  command = extended(0x08, Bytes(20));
  command[25] = 1;
  EXPECT_THAT(request(command), ElementsAre(0xB8, 0xB8));
  command = extended(0x08, Bytes(20));
  command.pop_back();
  EXPECT_THAT(request(command), ElementsAre(0xB8, 0xB8));
  EXPECT_THAT(request({0xA9, 0xA8}), ElementsAre(0xB8, 0xB8));
}

TEST_F(EmulatedU6, ConstantsAreNearNominalButDiffer) {
  EXPECT_NEAR(constant(0), 3.1580578e-4, 4e-6);
  EXPECT_NE(constant(0), 3.1580578e-4);
  EXPECT_NEAR(constant(9), 33523.0, 150.0);
  EXPECT_NEAR(constant(8), -3.1580578e-4, 4e-6);
  EXPECT_NEAR(constant(1), -constant(0) * constant(9), 1e-6);
  EXPECT_NEAR(constant(16), 13200.0, 250.0);
  const Bytes beyond = request(extended(0x2D, {0, 10}));
  EXPECT_EQ(beyond[6], 26);
  EXPECT_NE(u6_calibration_of_unit(1).adc.center, u6_calibration_of_unit(2).adc.center);
}

TEST_F(EmulatedU6, AnalogInputsFollowItsConstants) {
  const double slope = constant(8);
  const double center = constant(9);
  const Bytes reply = feedback({2, 2, 8, 0x00, 3, 3, 0x18, 0});
  expect_valid(reply);
  EXPECT_EQ(reply[6], 0);
  EXPECT_EQ(reply[8], 0x77);
  const double raw = (reply[9] + 256.0 * reply[10] + 65536.0 * reply[11]) / 256.0;
  EXPECT_NEAR((center - raw) * slope, -2.0, 1e-5);
  EXPECT_EQ(reply[15], 0x18);
  const double small = (reply[12] + 256.0 * reply[13] + 65536.0 * reply[14]) / 256.0;
  EXPECT_NEAR((small - constant(11)) * constant(2), 0.02, 1e-6);
  EXPECT_EQ(feedback({2, 16, 8, 0})[6], 97);
  EXPECT_EQ(feedback({2, 0, 0x58, 0})[6], 57);
}

TEST_F(EmulatedU6, FailingIoTypeIsReportedAndEarlierOnesAreExecuted) {
  const Bytes reply = feedback({38, 0x00, 0x80, 11, 31, 39, 0, 0});
  EXPECT_EQ(reply[6], 98);
  EXPECT_EQ(reply[7], 2);
  EXPECT_NEAR(u6.dac_volts(0), 32768.0 / 13200.0, 0.03);
  EXPECT_EQ(u6.dac_volts(1), 0.02);
  EXPECT_EQ(feedback({77})[6], 101);
}

TEST_F(EmulatedU6, OutputsDriveTheWires) {
  ASSERT_EQ(wires.driven.back().first, 0.02);  // after power-up
  const auto counts = static_cast<unsigned>(std::lround(constant(16) * 2.5 + constant(17)));
  now_ns = 5 * ms;
  feedback({38, static_cast<std::uint8_t>(counts), static_cast<std::uint8_t>(counts >> 8U)});
  EXPECT_NEAR(wires.driven.back().first, 2.5, 16.0 / 13200.0);
  EXPECT_EQ(wires.driven.back().second, 5 * ms);
  feedback({34, 0x80});
  EXPECT_NEAR(wires.driven.back().first, 32768.0 / 13200.0, 0.03);
}

TEST_F(EmulatedU6, DigitalLinesHaveDirections) {
  EXPECT_FALSE(wires.enabled.back().first);
  feedback({13, 0x82});  // output, and low
  EXPECT_EQ(wires.enabled.size(), 1U);
  feedback({11, 0x82});
  EXPECT_TRUE(wires.enabled.back().first);
  feedback({13, 0x02});  // input: the contact pulls it down
  EXPECT_FALSE(wires.enabled.back().first);
  EXPECT_EQ(feedback({10, 3, 10, 4})[9], 1);
  wires.fault = wires.pressed = true;
  const Bytes low = feedback({10, 3, 10, 4, 26});
  EXPECT_THAT(Bytes(low.begin() + 9, low.begin() + 14), ElementsAre(0, 0, 0xE3, 0xFF, 0x0F));
}

TEST_F(EmulatedU6, WatchdogSetsItsLineWithoutTheHost) {
  feedback({11, 0x82});
  ASSERT_TRUE(wires.enabled.back().first);
  EXPECT_EQ(request(extended(0x09, {1, 0x10, 2, 0, 2, 0, 0, 0, 0, 0}))[6], 0);
  EXPECT_EQ(request(extended(0x09, {1, 0x10, 0, 0, 2, 0, 0, 0, 0, 0}))[6], 6);
  now_ns = 1900 * ms;
  feedback({12, 2});
  now_ns = 3800 * ms;
  u6.catch_up();
  EXPECT_TRUE(wires.enabled.back().first);
  now_ns = 4000 * ms;
  u6.catch_up();
  EXPECT_FALSE(wires.enabled.back().first);
  EXPECT_EQ(wires.enabled.back().second, 3900 * ms);
  EXPECT_EQ(u6.watchdog_trips(), 1U);
}

TEST_F(EmulatedU6, StreamsTheSampledScans) {
  start();
  now_ns = 1000 * ms;
  const auto all = packets();
  ASSERT_EQ(all.size(), 984U / 25U);
  const double center = constant(9);  // refused while streaming
  EXPECT_EQ(center, 0.0);
  EXPECT_THAT(request({0xB0, 0xB0}), ElementsAre(0xB1, 0xB1, 0, 0));
  EXPECT_EQ(request({0xB0, 0xB0})[2], 52);
  const auto scans = u6.scans();
  const auto& adc = u6.calibration().adc;
  std::size_t sample = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Bytes& packet = all[i];
    ASSERT_EQ(packet.size(), 64U);
    expect_valid(packet);
    EXPECT_EQ(packet[1], 0xF9);
    EXPECT_EQ(packet[3], 0xC0);
    EXPECT_EQ(packet[10], i);
    for (std::size_t at = 12; at < 62; at += 2, ++sample) {
      const unsigned raw = packet[at] + 256U * packet[at + 1];
      const std::size_t channel = sample % 3;
      const int gain = channel == 2 ? 2 : 0;
      EXPECT_NEAR(raw, u6_counts(adc, gain, scans[sample / 3].volts[channel]), 0.51);
    }
  }
  EXPECT_EQ(scans[41].time_ns, 42 * ms);
  EXPECT_NEAR(scans[41].volts[1], -2.02, 1e-12);
}

TEST_F(EmulatedU6, CrystalErrorIsApplied) {
  LabjackU6Options fast = options();
  fast.crystal_error_ppm = 100.0;
  EmulatedLabjackU6 other(
      wires, [this] { return now_ns; }, fast);
  other.out(1, extended(0x11, {1, 0, 25, 0, 0, 0, 0xA0, 0x0F, 0, 0}));
  other.out(1, Bytes{0xA8, 0xA8});
  now_ns = 500 * ms;
  other.catch_up();
  const auto scans = other.scans();
  EXPECT_NEAR(static_cast<double>(scans[499].time_ns), 500e6 / 1.0001, 1.0);
}

TEST_F(EmulatedU6, FullFifoLosesScansAndReportsTheNumber) {
  start();
  now_ns = 1000 * ms;  // 3000 samples into 984 places: 328 scans are kept
  u6.catch_up();
  EXPECT_EQ(u6.scans_lost(), 1000U - 328U);
  std::vector<unsigned> samples;
  std::vector<int> errors;
  std::size_t reported = 0;
  for (int step = 0; step < 100; ++step) {
    for (const Bytes& packet : packets()) {
      errors.push_back(packet[11]);
      if (packet[11] == 60) reported = packet[6] + 256U * packet[7];
      for (std::size_t at = 12; at < 62; at += 2) {
        samples.push_back(packet[at] + 256U * packet[at + 1]);
      }
    }
    now_ns += ms;
  }
  EXPECT_EQ(reported, u6.scans_lost());
  EXPECT_EQ(u6.recoveries(), 1U);
  EXPECT_THAT(Bytes(errors.begin(), errors.begin() + 39), testing::Each(59));
  EXPECT_EQ(errors[39], 60);
  EXPECT_EQ(errors[40], 0);
  // 328 scans, the dummy, then the scans after the loss.
  EXPECT_THAT(std::vector(samples.begin() + 984, samples.begin() + 987), testing::Each(0xFFFFU));
  const auto scans = u6.scans();
  EXPECT_FALSE(scans[327].lost);
  EXPECT_TRUE(scans[328].lost);
  EXPECT_TRUE(scans[999].lost);
  EXPECT_FALSE(scans[1000].lost);
  EXPECT_NEAR(samples[987], u6_counts(u6.calibration().adc, 0, scans[1000].volts[0]), 0.51);
}

TEST_F(EmulatedU6, RejectsImpossibleStreams) {
  EXPECT_EQ(request({0xA8, 0xA8})[2], 50);  // not configured
  EXPECT_EQ(request(extended(0x11, {0, 0, 25, 0, 0, 0, 0xA0, 0x0F}))[6], 49);
  EXPECT_EQ(request(extended(0x11, {1, 0, 26, 0, 0, 0, 0xA0, 0x0F, 0, 0}))[6], 56);
  EXPECT_EQ(request(extended(0x11, {1, 0, 25, 0, 0, 0, 0, 0, 0, 0}))[6], 58);
  EXPECT_EQ(request(extended(0x11, {1, 0, 25, 0, 0, 0, 0xA0, 0x0F, 1, 0x80}))[6], 49);
  EXPECT_EQ(request(extended(0x11, {1, 9, 25, 0, 0, 0, 0xA0, 0x0F, 0, 0}))[6], 50);
  EXPECT_EQ(request(extended(0x11, {1, 0, 25, 0, 0, 0, 0xA0, 0x0F, 0, 0x40}))[6], 57);
  start(25, 200);  // 20 kHz of three channels
  const auto all = packets();
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0][11], 55);
}

TEST_F(EmulatedU6, InputsAreReservedDuringAStream) {
  start();
  EXPECT_EQ(feedback({38, 0, 0x40})[6], 0);
  EXPECT_EQ(feedback({38, 0, 0x50, 2, 0, 0, 0})[6], 48);
  EXPECT_EQ(feedback({10, 3})[6], 0);
  EXPECT_EQ(request(extended(0x2D, {0, 0}))[6], 48);
  EXPECT_EQ(request(extended(0x11, {1, 0, 25, 0, 0, 0, 0xA0, 0x0F, 0, 0}))[6], 48);
  EXPECT_EQ(request({0xA8, 0xA8})[2], 48);
}

TEST_F(EmulatedU6, FaultsAffectTheScheduledPackets) {
  start();
  u6.schedule(U6StreamFault::bad_checksum8, 1);
  u6.schedule(U6StreamFault::bad_checksum16, 2);
  u6.schedule(U6StreamFault::short_packet, 3);
  u6.schedule(U6StreamFault::lost, 4);
  u6.schedule(U6StreamFault::repeated, 5);
  u6.schedule(U6StreamFault::stall, 6);
  now_ns = 80 * ms;  // 240 samples, 9 packets
  const auto before = packets();
  ASSERT_EQ(before.size(), 6U);  // 0 1 2 3 5 5
  EXPECT_NE(before[1][0], folded(sum_of(before[1], 1, 6)));
  EXPECT_NE(before[2][4] + 256U * before[2][5], sum_of(before[2], 6, 64));
  EXPECT_EQ(before[3].size(), 40U);
  EXPECT_EQ(before[4][10], 5);
  EXPECT_EQ(before[4], before[5]);
  EXPECT_EQ(u6.in(3, 64).status, UsbStatus::stall);
  EXPECT_EQ(u6.in(3, 64).status, UsbStatus::stall);
  u6.clear_halt(0x83);
  EXPECT_EQ(packets().front()[10], 6);
  const auto corrupted = u6.faulty_packets();
  ASSERT_EQ(corrupted.size(), 6U);
  EXPECT_EQ(corrupted[3].first_scan, 100U / 3U);
  EXPECT_EQ(corrupted[3].last_scan, 124U / 3U);
}

TEST_F(EmulatedU6, FaultsAffectReplies) {
  const Bytes command = extended(0x00, {0, 10, 3});
  u6.schedule(U6ReplyFault::late, 0, {.late_ns = 20 * ms});
  u6.schedule(U6ReplyFault::missing, 1);
  u6.schedule(U6ReplyFault::error, 2, {.error = 8});
  u6.schedule(U6ReplyFault::stall, 3);
  u6.out(1, command);
  EXPECT_EQ(u6.in(2, 64).status, UsbStatus::not_ready);
  now_ns = 20 * ms;
  EXPECT_EQ(u6.in(2, 64).bytes.size(), 10U);
  u6.out(1, command);
  EXPECT_EQ(u6.in(2, 64).status, UsbStatus::not_ready);
  const Bytes error = request(command);
  expect_valid(error);
  EXPECT_EQ(error[6], 8);
  u6.out(1, command);
  EXPECT_EQ(u6.in(2, 64).status, UsbStatus::stall);
  u6.clear_halt(0x82);
  EXPECT_EQ(u6.in(2, 64).bytes.size(), 10U);
  u6.set_silent(true);
  u6.out(1, command);
  EXPECT_EQ(u6.in(2, 64).status, UsbStatus::not_ready);
}

}  // namespace
}  // namespace stickslip::emulated
