// SPDX-License-Identifier: Apache-2.0
// The emulated bridge, by its protocol.
#include "tests/emulated/phidget_bridge/emulated_phidget_bridge.h"

#include <gtest/gtest.h>

#include <cmath>

namespace stickslip::emulated {
namespace {

constexpr std::int64_t ms = 1'000'000;

struct SteadyWires final : Wires {
  double force = 2.0;
  double truth(Channel, std::int64_t) override { return force; }
  void drive(double, std::int64_t) override {}
  void enable(bool, std::int64_t) override {}
};

struct BridgeTest : testing::Test {
  SteadyWires wires;
  std::int64_t now_ns = 0;
  EmulatedPhidgetBridge::Options options;

  BridgeTest() { options.sensors[1] = Sensor{Channel::friction_force, 0.001, 0.0005}; }
  EmulatedPhidgetBridge bridge() {
    return EmulatedPhidgetBridge(options, wires, [this] { return now_ns; });
  }
  /// The next report; advances the clock until it arrives.
  Bytes next(EmulatedPhidgetBridge& device) {
    for (int i = 0; i < 300; ++i) {
      const UsbAnswer answer = device.in(1, 64);
      if (answer.status == UsbStatus::ok) return answer.bytes;
      now_ns += ms;
    }
    ADD_FAILURE() << "no report came";
    return Bytes(20, 0);
  }
  static double ratio(const Bytes& report, std::size_t input, double gain) {
    const std::size_t at = 6 + 3 * input;
    const int raw = report[at] << 16 | report[at + 1] << 8 | report[at + 2];
    return (raw - 0x800000) / 8388608.0 / gain;
  }
};

const Bytes input_1_at_gain_8{0x02, 0x03, 0x00, 2, 0, 0, 0, 0};  // 16 ms

TEST_F(BridgeTest, DescribesItselfAsAHidDevice) {
  options.firmware = 101;
  auto device = bridge();
  const Bytes descriptor = device.device_descriptor();
  ASSERT_EQ(descriptor.size(), 18U);
  EXPECT_EQ(descriptor[8] | descriptor[9] << 8, 0x06C2);
  EXPECT_EQ(descriptor[10] | descriptor[11] << 8, 0x003B);
  EXPECT_EQ(descriptor[13] * 100 + descriptor[12], 101);
  EXPECT_EQ(device.string(descriptor[16]), "123456");
  const Bytes configuration = device.configuration_descriptor();
  EXPECT_EQ(configuration[2], configuration.size());
  EXPECT_EQ(configuration[14], 3);  // HID
  const UsbAnswer report = device.control({0x81, 0x06, 0x2200, 0, 255}, {});
  ASSERT_EQ(report.status, UsbStatus::ok);
  EXPECT_EQ(report.bytes.size(), configuration[25]);
  EXPECT_EQ(report.bytes[15], 20);
  EXPECT_EQ(report.bytes.back(), 0xC0);
}

TEST_F(BridgeTest, ReportsBeforeItIsConfigured) {
  auto device = bridge();
  EXPECT_EQ(device.in(1, 64).status, UsbStatus::not_ready);
  const Bytes report = next(device);
  EXPECT_EQ(now_ns, 8 * ms);
  EXPECT_EQ(report.size(), 20U);
  EXPECT_EQ(report[0], 0);
  EXPECT_EQ(report[5], 1);
}

TEST_F(BridgeTest, MeasuresWithGainAndRepeatsItsSettings) {
  auto device = bridge();
  ASSERT_EQ(device.out(1, input_1_at_gain_8), UsbStatus::ok);
  EXPECT_EQ(next(device)[0], 0x02);  // the first sample is invalid
  const std::int64_t first_ns = now_ns;
  const Bytes report = next(device);
  EXPECT_EQ(now_ns - first_ns, 16 * ms);
  EXPECT_EQ(report[0], 0x22);
  EXPECT_EQ(report[1], 0);
  EXPECT_EQ(report[2], 0x03);
  EXPECT_EQ(report[3], 0);
  EXPECT_EQ(report[4], 0);
  EXPECT_EQ(report[5], 2);
  EXPECT_NEAR(ratio(report, 1, 8.0), 0.0025, 0.6 / 8388608.0 / 8.0);
}

TEST_F(BridgeTest, TakesSettingsBySetReportAsWell) {
  options.out_endpoint = false;
  auto device = bridge();
  EXPECT_EQ(device.out(1, input_1_at_gain_8), UsbStatus::stall);
  EXPECT_EQ(device.control({0x21, 0x09, 0x0200, 0, 8}, input_1_at_gain_8).status, UsbStatus::ok);
  EXPECT_TRUE(device.enabled(1));
  EXPECT_EQ(device.interval_ms(), 16);
}

TEST_F(BridgeTest, DoesNotEchoUnsupportedSettings) {
  auto device = bridge();
  device.out(1, Bytes{0x02, 0x02, 0x00, 126, 0});
  const Bytes report = next(device);
  EXPECT_EQ(report[2], 0);
  EXPECT_EQ(report[5], 1);
}

TEST_F(BridgeTest, ReportsOutOfRange) {
  wires.force = 200.0;  // 0.2005 V/V, and the range at gain 8 is 0.125
  auto device = bridge();
  device.out(1, input_1_at_gain_8);
  next(device);
  const Bytes report = next(device);
  EXPECT_EQ(report[1], 0x02);
  EXPECT_EQ(report[9], 0xFF);
  EXPECT_EQ(report[10], 0xFF);
  EXPECT_EQ(report[11], 0xFF);
}

TEST_F(BridgeTest, OldFirmwareAppliesANewGainLate) {
  options.firmware = 100;
  auto device = bridge();
  device.out(1, input_1_at_gain_8);
  for (int i = 0; i < 100; ++i) {  // input 0 is not enabled: it never happens
    const Bytes report = next(device);
    EXPECT_EQ(report[2], 0x03);
    if (i > 0) {
      EXPECT_NEAR(ratio(report, 1, 1.0), 0.0025, 1e-6);
    }
  }
  device.out(1, Bytes{0x03, 0x03, 0x00, 2, 0});
  for (int i = 0; i < 32; ++i) EXPECT_NEAR(ratio(next(device), 1, 1.0), 0.0025, 1e-6) << i;
  EXPECT_NEAR(ratio(next(device), 1, 8.0), 0.0025, 1e-6);
}

TEST_F(BridgeTest, OldFirmwareReportsItsFirstSample) {
  options.firmware = 101;
  auto device = bridge();
  device.out(1, input_1_at_gain_8);
  const Bytes report = next(device);
  EXPECT_EQ(report[0], 0x22);
  EXPECT_LT(ratio(report, 1, 1.0), -0.4);
}

TEST_F(BridgeTest, NoiseIsTheSameForTheSameSeed) {
  options.noise_v_per_v = 1e-5;
  auto one = bridge();
  auto other = bridge();
  one.out(1, input_1_at_gain_8);
  other.out(1, input_1_at_gain_8);
  double sum = 0.0;
  for (int i = 0; i < 200; ++i) {
    now_ns += 16 * ms;
    const Bytes report = one.in(1, 64).bytes;
    EXPECT_EQ(report, other.in(1, 64).bytes);
    if (i > 0) sum += std::pow(ratio(report, 1, 8.0) - 0.0025, 2);
  }
  EXPECT_NEAR(std::sqrt(sum / 199), 1e-5, 2e-6);
}

TEST_F(BridgeTest, LateHostLosesTheOldestReports) {
  auto device = bridge();
  now_ns = 100 * 8 * ms;
  int came = 0;
  while (device.in(1, 64).status == UsbStatus::ok) ++came;
  EXPECT_EQ(came, 4);
  EXPECT_EQ(device.injected().overwritten, 96U);
}

TEST_F(BridgeTest, FaultsCanBeInjected) {
  auto device = bridge();
  device.out(1, input_1_at_gain_8);
  next(device);
  device.faults.invalid = 1.0;
  EXPECT_EQ(next(device)[0], 0x02);
  device.faults = {};
  device.faults.out_of_range = 1.0;
  EXPECT_EQ(next(device)[1], 0x0F);
  device.faults = {};
  device.faults.wrong_echo = 1.0;
  EXPECT_EQ(next(device)[2], 0x33);
  device.faults = {};
  device.faults.short_report = 1.0;
  EXPECT_EQ(next(device).size(), 5U);
  device.faults = {};
  device.faults.stall = true;
  EXPECT_EQ(device.in(1, 64).status, UsbStatus::stall);
  EXPECT_EQ(device.in(1, 64).status, UsbStatus::stall);
  device.clear_halt(0x81);
  EXPECT_EQ(next(device)[0], 0x22);
  device.faults.missing = 0.5;
  for (int i = 0; i < 1000; ++i) {
    now_ns += 16 * ms;
    device.in(1, 64);
  }
  EXPECT_NEAR(static_cast<double>(device.injected().missing), 500.0, 60.0);
  device.faults = {};
  device.faults.silent = true;
  now_ns += 160 * ms;
  while (device.in(1, 64).status == UsbStatus::ok) now_ns += ms;
  EXPECT_EQ(device.in(1, 64).status, UsbStatus::not_ready);
}

TEST_F(BridgeTest, LosesItsSettingsWithoutPower) {
  auto device = bridge();
  device.out(1, input_1_at_gain_8);
  device.reset();
  EXPECT_EQ(next(device)[0], 0);
  EXPECT_EQ(device.interval_ms(), 8);
}

}  // namespace
}  // namespace stickslip::emulated
