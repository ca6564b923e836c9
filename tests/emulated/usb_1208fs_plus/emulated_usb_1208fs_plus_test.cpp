// SPDX-License-Identifier: Apache-2.0
// The emulated board, by its protocol.
#include "tests/emulated/usb_1208fs_plus/emulated_usb_1208fs_plus.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <utility>
#include <vector>

namespace stickslip::emulated {
namespace {

constexpr std::int64_t ms = 1'000'000;

struct RecordingWires final : Wires {
  std::vector<std::pair<double, std::int64_t>> driven;
  /// A ramp, so that a sample shows its time.
  double truth(Channel, std::int64_t time_ns) override {
    return static_cast<double>(time_ns) * 1e-9;
  }
  void drive(double volts, std::int64_t time_ns) override { driven.emplace_back(volts, time_ns); }
  void enable(bool, std::int64_t) override {}
};

void put_word(Bytes& bytes, std::uint32_t value) {
  for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

struct BoardTest : testing::Test {
  RecordingWires wires;
  std::int64_t now_ns = 0;
  EmulatedUsb1208fsPlus::Options options;

  BoardTest() {
    options.imperfect = false;
    options.sensors[0] = Sensor{Channel::displacement, 1.0, 0.0};
    options.sensors[3] = Sensor{Channel::velocity, 0.0, -2.5};
  }
  EmulatedUsb1208fsPlus board() {
    return EmulatedUsb1208fsPlus(options, wires, [this] { return now_ns; });
  }
  static UsbStatus write(UsbDevice& device, std::uint8_t request, const Bytes& data = {},
                         std::uint16_t value = 0, std::uint16_t index = 0) {
    return device
        .control({0x40, request, value, index, static_cast<std::uint16_t>(data.size())}, data)
        .status;
  }
  static Bytes request(UsbDevice& device, std::uint8_t request, std::uint16_t length,
                       std::uint16_t value = 0, std::uint16_t index = 0) {
    return device.control({0xC0, request, value, index, length}, {}).bytes;
  }
  static int status(UsbDevice& device) {
    const Bytes bytes = request(device, 0x44, 2);
    return bytes[0] | bytes[1] << 8;
  }
  static UsbStatus start_input(UsbDevice& device, std::uint32_t samples, double rate_hz,
                               std::uint8_t mask, std::uint8_t scan_options) {
    Bytes data;
    put_word(data, samples);
    put_word(data, 0);
    put_word(data, static_cast<std::uint32_t>(std::lround(60e6 / rate_hz - 1)));
    data.push_back(mask);
    data.push_back(scan_options);
    return write(device, 0x11, data);
  }
  static UsbStatus start_output(UsbDevice& device, std::uint32_t scans, double rate_hz,
                                std::uint8_t mask) {
    Bytes data;
    put_word(data, scans);
    put_word(data, static_cast<std::uint32_t>(std::lround(60e6 / rate_hz - 1)));
    data.push_back(mask);
    return write(device, 0x1A, data);
  }
  static int code(const Bytes& bytes, std::size_t sample) {
    return bytes[2 * sample] | bytes[2 * sample + 1] << 8;
  }
};

TEST_F(BoardTest, IdentifiesItself) {
  auto device = board();
  const Bytes descriptor = device.device_descriptor();
  EXPECT_EQ(descriptor[8] | descriptor[9] << 8, 0x09DB);
  EXPECT_EQ(descriptor[10] | descriptor[11] << 8, 0x00E8);
  EXPECT_EQ(device.configuration_descriptor().size(), device.configuration_descriptor()[2]);
  EXPECT_EQ(request(device, 0x48, 8), (Bytes{'0', '1', 'A', '2', 'B', '3', 'C', '4'}));
  EXPECT_EQ(device.control({0xC0, 0x77, 0, 0, 8}, {}).status, UsbStatus::stall);
}

TEST_F(BoardTest, CodesOfTheRangesFollowTheFormula) {
  auto device = board();
  now_ns = 900 * ms;  // 0.9 V at CH0
  const double ranges_v[] = {20, 10, 5, 4, 2.5, 2, 1.25, 1};
  for (std::uint16_t range = 0; range < 8; ++range) {
    const Bytes bytes = request(device, 0x10, 2, 0x0100, range);
    EXPECT_NEAR(code(bytes, 0), 2048 + 0.9 * 2048 / ranges_v[range], 0.51) << range;
  }
  EXPECT_NEAR(code(request(device, 0x10, 2, 0x0101, 2), 0), 2048 + 2.5 * 2048 / 5, 0.51);
  const int single = code(request(device, 0x10, 2, 0x0003, 0), 0);
  EXPECT_NEAR(single, 2048 - 2.5 * 2048 / 10, 1.01);
  EXPECT_EQ(single % 2, 0);
}

TEST_F(BoardTest, CalibrationMemoryCorrectsItsCodes) {
  options.imperfect = true;
  auto device = board();
  now_ns = 900 * ms;
  const auto corrected = [&](int raw, std::uint16_t address) {
    const Bytes memory = request(device, 0x30, 8, address);
    const auto number = [&](std::size_t at) {
      std::uint32_t bits = 0;
      for (std::size_t i = 4; i-- > 0;) bits = bits << 8U | memory[at + i];
      return static_cast<double>(std::bit_cast<float>(bits));
    };
    EXPECT_NE(number(0), 1.0);
    return raw * number(0) + number(4);
  };
  const int differential = code(request(device, 0x10, 2, 0x0100, 4), 0);
  EXPECT_NEAR(corrected(differential, 8 * (4 * 4 + 0)), 2048 + 0.9 * 2048 / 2.5, 0.6);
  const int single = code(request(device, 0x10, 2, 0x0003, 0), 0);
  EXPECT_NEAR(corrected(single, 0x100 + 8 * 3), 2048 - 512, 1.1);
  EXPECT_EQ(request(device, 0x30, 768).size(), 768U);
}

TEST_F(BoardTest, ScanSamplesItsChannelsInOrderAtItsRate) {
  auto device = board();
  ASSERT_EQ(write(device, 0x14, Bytes(8, 7)), UsbStatus::ok);
  EXPECT_EQ(request(device, 0x14, 8), Bytes(8, 7));
  ASSERT_EQ(start_input(device, 0, 2000.0, 0b1001, 0), UsbStatus::ok);  // 1000 scans a second
  EXPECT_EQ(status(device), 2);
  EXPECT_EQ(write(device, 0x14, Bytes(8, 0)), UsbStatus::stall);
  EXPECT_EQ(device.control({0xC0, 0x10, 0, 0, 2}, {}).status, UsbStatus::stall);
  now_ns = 15 * ms;
  EXPECT_EQ(device.in(1, 512).status, UsbStatus::not_ready);  // 31 of 32 samples
  now_ns = 15 * ms + ms / 2;
  EXPECT_EQ(device.in(1, 512).bytes.size(), 64U);
  now_ns = 900 * ms;
  const Bytes bytes = device.in(1, 512).bytes;
  ASSERT_EQ(bytes.size(), 512U);
  for (std::size_t scan = 0; scan < 128; ++scan) {
    const double volts = static_cast<double>(16 + scan) * 1e-3;
    EXPECT_NEAR(code(bytes, 2 * scan), 2048 + volts * 204.8, 1.01);
    EXPECT_EQ(code(bytes, 2 * scan + 1), 1536);
  }
  write(device, 0x12);
  EXPECT_EQ(status(device), 0);
}

TEST_F(BoardTest, PacerClocksConversions) {
  options.sensors[3] = Sensor{Channel::velocity, 1.0, 0.0};  // both show the time
  auto device = board();
  ASSERT_EQ(start_input(device, 0, 20.0, 0b1001, 1), UsbStatus::ok);
  now_ns = 1000 * ms;
  ASSERT_EQ(device.scans().size(), 0U);
  device.in(1, 64);
  ASSERT_EQ(device.scans().size(), 11U);
  for (std::size_t i = 0; i < 10; ++i) {
    const Usb1208fsPlusScan& scan = device.scans()[i];
    EXPECT_EQ(scan.begins, i == 0);
    EXPECT_EQ(scan.time_ns, static_cast<std::int64_t>(i) * 100 * ms);
    ASSERT_EQ(scan.volts.size(), 2U);
    EXPECT_NEAR(scan.volts[1] - scan.volts[0], 0.05, 1e-12);
  }
  // The total conversion rate is limited.
  write(device, 0x12);
  EXPECT_EQ(start_input(device, 0, 50000.0, 0xFF, 0), UsbStatus::ok);
  write(device, 0x12);
  EXPECT_EQ(start_input(device, 0, 53000.0, 0b1, 0), UsbStatus::stall);
}

TEST_F(BoardTest, ScansAreImmediateOnRequest) {
  auto device = board();
  start_input(device, 0, 200.0, 0b1001, 1);
  EXPECT_EQ(device.in(1, 64).status, UsbStatus::not_ready);
  now_ns = 5 * ms;
  EXPECT_EQ(device.in(1, 64).bytes.size(), 4U);
  EXPECT_EQ(device.in(1, 64).status, UsbStatus::not_ready);
  now_ns = 25 * ms;
  EXPECT_EQ(device.in(1, 512).bytes.size(), 4U);  // one packet each, which ends the transfer
  EXPECT_EQ(device.in(1, 512).bytes.size(), 4U);
}

TEST_F(BoardTest, FullLastPacketIsFollowedByAnEmptyOne) {
  auto device = board();
  start_input(device, 64, 1000.0, 1, 0);
  now_ns = 200 * ms;
  EXPECT_EQ(device.in(1, 128).bytes.size(), 128U);
  const UsbAnswer end = device.in(1, 128);
  EXPECT_EQ(end.status, UsbStatus::ok);
  EXPECT_TRUE(end.bytes.empty());
  EXPECT_EQ(device.in(1, 128).status, UsbStatus::not_ready);
  EXPECT_EQ(status(device), 0);
  start_input(device, 40, 1000.0, 1, 0);
  now_ns = 400 * ms;
  EXPECT_EQ(device.in(1, 128).bytes.size(), 80U);
  EXPECT_EQ(device.in(1, 128).status, UsbStatus::not_ready);
}

TEST_F(BoardTest, LateHostFindsAStalledEndpoint) {
  options.input_fifo_bytes = 1024;
  auto device = board();
  start_input(device, 0, 1000.0, 1, 0);
  now_ns = 600 * ms;
  EXPECT_EQ(device.in(1, 64).status, UsbStatus::stall);
  EXPECT_EQ(status(device), 4);
  EXPECT_EQ(start_input(device, 0, 1000.0, 1, 0), UsbStatus::stall);
  device.clear_halt(0x81);
  write(device, 0x15);
  EXPECT_EQ(start_input(device, 0, 1000.0, 1, 0), UsbStatus::ok);
  EXPECT_EQ(status(device), 2);
}

TEST_F(BoardTest, LosesScansInsteadOfStallingOnRequest) {
  options.input_fifo_bytes = 1024;
  auto device = board();
  start_input(device, 0, 1000.0, 1, 0x80);
  now_ns = 600 * ms;
  EXPECT_EQ(device.in(1, 4096).bytes.size(), 1024U);
  EXPECT_EQ(status(device), 6);
  EXPECT_EQ(device.injected().input_samples_dropped, 601U - 512U);
}

TEST_F(BoardTest, ImmediateOutputDrivesImmediately) {
  auto device = board();
  wires.driven.clear();
  now_ns = 5 * ms;
  EXPECT_EQ(write(device, 0x18, {}, 2048, 0), UsbStatus::ok);
  ASSERT_EQ(wires.driven.size(), 1U);
  EXPECT_EQ(wires.driven[0], std::make_pair(2.5, 5 * ms));
  write(device, 0x18, {}, 100, 1);  // not connected
  EXPECT_EQ(wires.driven.size(), 1U);
  EXPECT_EQ(request(device, 0x18, 4), (Bytes{0, 8, 100, 0}));
}

TEST_F(BoardTest, PacedOutputDrivesAtItsRate) {
  auto device = board();
  wires.driven.clear();
  Bytes data;
  for (int i = 0; i < 40; ++i) {
    data.push_back(static_cast<std::uint8_t>(i));
    data.push_back(4);
  }
  EXPECT_EQ(start_output(device, 40, 500.0, 1), UsbStatus::ok);
  now_ns = 7 * ms;  // no data yet
  EXPECT_EQ(device.out(2, data), UsbStatus::ok);
  EXPECT_EQ(status(device), 8);
  EXPECT_EQ(write(device, 0x18, {}, 0, 0), UsbStatus::stall);
  now_ns = 200 * ms;
  EXPECT_EQ(status(device), 0);  // completed without underrun
  ASSERT_EQ(wires.driven.size(), 40U);
  for (int i = 0; i < 40; ++i) {
    const auto& [volts, time_ns] = wires.driven[static_cast<std::size_t>(i)];
    EXPECT_DOUBLE_EQ(volts, (1024 + i) * 5.0 / 4096.0);
    EXPECT_EQ(time_ns, 7 * ms + i * 2 * ms);
  }
}

TEST_F(BoardTest, OutputUnderrunStalls) {
  auto device = board();
  EXPECT_EQ(device.out(2, Bytes(8, 1)), UsbStatus::ok);  // before the start
  start_output(device, 0, 1000.0, 1);
  now_ns = 10 * ms;
  EXPECT_EQ(status(device), 16);
  EXPECT_EQ(device.out(2, Bytes(8, 1)), UsbStatus::stall);
  device.clear_halt(0x02);
  EXPECT_EQ(device.out(2, Bytes(8, 1)), UsbStatus::ok);
  EXPECT_NEAR(device.output_v(0), 0x101 * 5.0 / 4096.0, 1e-12);  // holds the last value
}

TEST_F(BoardTest, FullFifoRejectsDataUntilThereIsSpace) {
  options.output_fifo_bytes = 256;
  auto device = board();
  const Bytes data(320, 2);
  EXPECT_EQ(device.out(2, data), UsbStatus::not_ready);
  EXPECT_EQ(device.output_fifo_level(), 256U);
  EXPECT_EQ(device.out(2, data), UsbStatus::not_ready);
  start_output(device, 0, 1000.0, 1);
  now_ns = 50 * ms;
  EXPECT_EQ(device.out(2, data), UsbStatus::ok);
  EXPECT_EQ(device.output_fifo_level(), 320U - 2U * 51U);
}

TEST_F(BoardTest, OutputIsZeroWithoutPower) {
  auto device = board();
  write(device, 0x18, {}, 4095, 0);
  now_ns = 9 * ms;
  device.unplug();
  EXPECT_EQ(wires.driven.back(), std::make_pair(0.0, 9 * ms));
}

TEST_F(BoardTest, FaultsCanBeInjected) {
  auto device = board();
  start_input(device, 0, 1000.0, 1, 0);
  now_ns = 100 * ms;  // 101 samples, three packets
  device.faults.repeated_packet = 1.0;
  const Bytes twice = device.in(1, 128).bytes;
  ASSERT_EQ(twice.size(), 128U);
  EXPECT_EQ(Bytes(twice.begin(), twice.begin() + 64), Bytes(twice.begin() + 64, twice.end()));
  device.faults = {};
  device.faults.short_packet = 1.0;
  const Bytes torn = device.in(1, 512).bytes;
  EXPECT_LT(torn.size(), 64U);
  EXPECT_EQ(torn.size() % 2, 0U);
  device.faults = {};
  device.faults.silence = true;
  EXPECT_EQ(device.in(1, 512).status, UsbStatus::not_ready);
  device.faults = {};
  device.faults.stall = true;
  EXPECT_EQ(device.in(1, 512).status, UsbStatus::stall);
  device.clear_halt(0x81);
  EXPECT_EQ(device.in(1, 512).bytes.size(), 64U);
  EXPECT_EQ(device.injected().stall, 1U);
}

TEST_F(BoardTest, FastCrystalTakesMoreSamples) {
  options.crystal = 1e-2;
  auto device = board();
  start_input(device, 0, 1000.0, 1, 1);
  now_ns = 1000 * ms;
  int came = 0;
  while (device.in(1, 64).status == UsbStatus::ok) ++came;
  EXPECT_EQ(came, 1011);
}

}  // namespace
}  // namespace stickslip::emulated
