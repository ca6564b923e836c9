// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/attach/emulated_hidapi.h"

#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hidapi/hidapi.h>

#include <array>
#include <deque>
#include <filesystem>
#include <mutex>
#include <string>

#include "drivers/clock/host_clock.h"
#include "drivers/phidget_bridge/phidget_bridge.h"

namespace stickslip::emulated {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A HID device that echoes its output reports. With `bridge` it accepts settings and reports them
/// like a PhidgetBridge.
class Echo final : public UsbDevice {
 public:
  explicit Echo(bool output_endpoint, std::uint8_t firmware = 2)
      : output_endpoint_(output_endpoint), firmware_(firmware) {}

  Bytes device_descriptor() const override {
    return {18, 1, 0x10, 1, 0, 0, 0, 8, 0xC2, 0x06, 0x3B, 0, firmware_, firmware_major, 1, 2, 3, 1};
  }
  Bytes configuration_descriptor() const override {
    Bytes bytes = {9, 2, 0, 0, 1, 1, 0, 0x80, 250, 9,  4, 0, 0,
                   1, 3, 0, 0, 0, 7, 5, 0x81, 3,   64, 0, 8};
    if (output_endpoint_) {
      const Bytes out = {7, 5, 0x01, 3, 64, 0, 8};
      bytes.insert(bytes.end(), out.begin(), out.end());
      bytes[13] = 2;
    }
    bytes[2] = static_cast<std::uint8_t>(bytes.size());
    return bytes;
  }
  std::string string(std::uint8_t index) const override {
    return index == 2 ? "PhidgetBridge" : index == 3 ? "141234" : "Phidgets Inc.";
  }
  UsbAnswer control(const UsbSetup& setup, std::span<const std::uint8_t> out) override {
    if (setup.request == 0x09) {
      got(out);
      return {};
    }
    if (setup.request == 0x01)
      return {UsbStatus::ok, {0x55, static_cast<std::uint8_t>(setup.value)}};
    return {UsbStatus::stall, {}};
  }
  UsbStatus out(std::uint8_t, std::span<const std::uint8_t> bytes) override {
    got(bytes);
    return UsbStatus::ok;
  }
  UsbAnswer in(std::uint8_t, std::size_t) override {
    const std::lock_guard hold(lock);
    if (bridge && (received[0] & 0x0F) != 0) {
      const std::uint8_t mask = received[0];
      Bytes report = {static_cast<std::uint8_t>(mask * 0x11),
                      0,
                      received[1],
                      received[2],
                      received[4],
                      received[3],
                      0x80,
                      0,
                      0,
                      0xC0,
                      0,
                      0,
                      0x80,
                      0,
                      0,
                      0xFF,
                      0xFF,
                      0xFF};
      return {UsbStatus::ok, report};
    }
    if (reports.empty()) return {UsbStatus::not_ready, {}};
    UsbAnswer answer{UsbStatus::ok, reports.front()};
    reports.pop_front();
    return answer;
  }
  void reset() override {}

  std::mutex lock;
  bool bridge = false;
  std::deque<Bytes> reports;
  Bytes received = Bytes(64);
  std::uint8_t firmware_major = 1;

 private:
  void got(std::span<const std::uint8_t> bytes) {
    const std::lock_guard hold(lock);
    received.assign(bytes.begin(), bytes.end());
    if (!bridge) reports.push_back(received);
  }
  bool output_endpoint_;
  std::uint8_t firmware_;
};

std::filesystem::path file_of(void* function) {
  Dl_info info{};
  return dladdr(function, &info) != 0 ? std::filesystem::canonical(info.dli_fname) : "";
}

TEST(EmulatedHidapi, ProgramLinksTheEmulation) {
  const auto program = std::filesystem::canonical("/proc/self/exe");
  EXPECT_EQ(file_of(reinterpret_cast<void*>(&hid_enumerate)), program);
  EXPECT_EQ(file_of(reinterpret_cast<void*>(&hid_read_timeout)), program);
  EXPECT_EQ(dlopen("libhidapi-hidraw.so.0", RTLD_NOW | RTLD_NOLOAD), nullptr);
  EXPECT_EQ(hid_enumerate(0, 0), nullptr) << "no bus, no device";
}

class EmulatedHidapiOutput : public testing::TestWithParam<bool> {};

TEST_P(EmulatedHidapiOutput, OutputAndInputReportsAreTransferred) {
  EmulatedBus bus;
  Echo echo(GetParam());
  bus.plug(echo, 1);
  hid_device_info* list = hid_enumerate(0x06C2, 0x003B);
  ASSERT_NE(list, nullptr);
  EXPECT_EQ(std::wstring(list->serial_number), L"141234");
  EXPECT_EQ(list->release_number, 0x0102);
  EXPECT_EQ(list->next, nullptr);
  hid_device* device = hid_open_path(list->path);
  ASSERT_NE(device, nullptr);
  std::array<unsigned char, 64> in{};
  EXPECT_EQ(hid_read_timeout(device, in.data(), in.size(), 5), 0);
  const std::array<unsigned char, 4> out = {0, 7, 8, 9};
  EXPECT_EQ(hid_write(device, out.data(), out.size()), 4);
  EXPECT_THAT(echo.received, ElementsAre(7, 8, 9));
  ASSERT_EQ(hid_read_timeout(device, in.data(), in.size(), 1000), 3);
  EXPECT_EQ(in[2], 9);
  in[0] = 4;
  EXPECT_EQ(hid_get_feature_report(device, in.data(), 8), 2);
  EXPECT_EQ(in[1], 4);
  bus.refuse_access(echo);
  EXPECT_EQ(hid_open_path(list->path), nullptr);
  bus.unplug(echo);
  EXPECT_EQ(hid_read_timeout(device, in.data(), in.size(), 1000), -1);
  EXPECT_EQ(hid_write(device, out.data(), out.size()), -1);
  hid_close(device);
  hid_free_enumeration(list);
  EXPECT_EQ(bus.open_handles(), 0);
}
INSTANTIATE_TEST_SUITE_P(EndpointOrSetReport, EmulatedHidapiOutput, testing::Bool());

struct EmulatedHidapiBridge : testing::Test {
  EmulatedBus bus;
  drivers::MonotonicHostClock clock;
  config::PhidgetBridge settings;
  config::BenchInputs inputs;
  EmulatedHidapiBridge() {
    inputs[2] = config::BenchInput{"phidget_bridge", "1", 10.0, false, 1};
    inputs[3] = config::BenchInput{"phidget_bridge", "3", 10.0, false, 128};
  }
};

TEST_F(EmulatedHidapiBridge, IsReadAndLost) {
  Echo echo(true, 10);
  echo.bridge = true;
  bus.plug(echo, 1);
  drivers::PhidgetBridge gauge(settings, inputs, clock);
  const auto opened = gauge.open();
  ASSERT_TRUE(opened) << opened.message;
  EXPECT_THAT(Bytes(echo.received.begin(), echo.received.begin() + 5),
              ElementsAre(0x0A, 0x00, 0x07, 1, 0));
  EXPECT_EQ(gauge.name(), "PhidgetBridge 1046 #141234");
  std::array<drivers::Reading, 2> readings{};
  ASSERT_TRUE(gauge.read(readings));
  EXPECT_EQ(readings[0].value, 0.5);
  EXPECT_TRUE(readings[0].valid);
  EXPECT_FALSE(readings[1].valid) << "at the limit of its range";
  bus.unplug(echo);
  drivers::Result result;
  for (int i = 0; i < 100 && result; ++i) result = gauge.read(readings);
  EXPECT_EQ(result.outcome, drivers::Outcome::lost);
  gauge.close();
  EXPECT_EQ(gauge.open().outcome, drivers::Outcome::lost);
}

TEST_F(EmulatedHidapiBridge, RejectsUnsupportedVersions) {
  Echo newer(true);
  newer.firmware_major = 3;
  bus.plug(newer, 1);
  drivers::PhidgetBridge gauge(settings, inputs, clock);
  const auto refused = gauge.open();
  EXPECT_EQ(refused.outcome, drivers::Outcome::needs_attention);
  EXPECT_THAT(refused.message, HasSubstr("1046_1 or newer, which uses a different protocol"));
  const auto found = drivers::find_phidget_bridge();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].name, "PhidgetBridge 1046 #141234, firmware 3.02");
  EXPECT_THAT(found[0].problem, HasSubstr("a different protocol"));
}

TEST_F(EmulatedHidapiBridge, ReportsTheRemedyForDeniedAccess) {
  Echo echo(true);
  bus.plug(echo, 1);
  bus.refuse_access(echo);
  drivers::PhidgetBridge gauge(settings, inputs, clock);
  const auto refused = gauge.open();
  EXPECT_EQ(refused.outcome, drivers::Outcome::needs_attention);
  EXPECT_THAT(refused.message, HasSubstr("70-stickslip.rules"));
}

TEST_F(EmulatedHidapiBridge, ReportsInvalidSettings) {
  const auto refusal = [&] {
    drivers::PhidgetBridge gauge(settings, inputs, clock);
    return std::string(gauge.open().message);
  };
  inputs[2]->gain = 2;
  EXPECT_THAT(refusal(), HasSubstr("the gain of input 1 is 2; it has 1, 8, 16"));
  inputs[2]->gain = 1;
  inputs[2]->input = "3";
  EXPECT_THAT(refusal(), HasSubstr("assigned to two channels"));
  inputs[2]->input = "4";
  EXPECT_THAT(refusal(), HasSubstr("there is no input 4"));
  inputs[2]->input = "1";
  settings.interval_ms = 12;
  EXPECT_THAT(refusal(), HasSubstr("interval_ms is 12; it must be a multiple of 8"));
}

}  // namespace
}  // namespace stickslip::emulated
