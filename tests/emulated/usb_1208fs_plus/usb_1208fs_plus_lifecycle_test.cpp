// SPDX-License-Identifier: Apache-2.0
// Lifecycle and threads of the driver, with a minimal board. Measurements are tested with the
// emulated board.
#include "drivers/usb_1208fs_plus/usb_1208fs_plus_driver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <libusb-1.0/libusb.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "tests/emulated/attach/emulated_libusb.h"

// Interceptions of library calls, by the linker.
namespace {
std::atomic<bool> kernel_keeps{false};
std::atomic<bool> events_fail{false};
std::atomic<int> events_handled{0};
}  // namespace
extern "C" {
int __real_libusb_cancel_transfer(libusb_transfer* transfer);
int __wrap_libusb_cancel_transfer(libusb_transfer* transfer) {
  return kernel_keeps ? 0 : __real_libusb_cancel_transfer(transfer);
}
int __real_libusb_handle_events_timeout_completed(libusb_context*, timeval*, int*);
int __wrap_libusb_handle_events_timeout_completed(libusb_context* context, timeval* timeout,
                                                  int* completed) {
  ++events_handled;
  if (events_fail) return LIBUSB_ERROR_IO;
  return __real_libusb_handle_events_timeout_completed(context, timeout, completed);
}
}

namespace stickslip::drivers {
namespace {

using emulated::Bytes;
using emulated::UsbAnswer;
using emulated::UsbSetup;
using emulated::UsbStatus;
using testing::HasSubstr;
using testing::IsEmpty;

/// Scans by the host's clock; channel c of every scan has code 2048 + 100 c.
class FakeBoard final : public emulated::UsbDevice {
 public:
  explicit FakeBoard(std::string serial = "01A2B3C4") : serial_(std::move(serial)) {}

  Bytes device_descriptor() const override {
    return {18, 1, 0, 2, 0xFF, 0, 0, 64, 0xDB, 0x09, 0xE8, 0, 0, 1, 1, 2, 3, 1};
  }
  Bytes configuration_descriptor() const override {
    return {9, 2, 32, 0, 1,    1, 0,  0x80, 250, 9, 4, 0,    0, 2,  0xFF, 0,
            0, 0, 7,  5, 0x81, 2, 64, 0,    0,   7, 5, 0x02, 2, 64, 0,    0};
  }
  std::string string(std::uint8_t) const override { return "board"; }
  void reset() override { stop(); }

  UsbAnswer control(const UsbSetup& setup, std::span<const std::uint8_t> out) override {
    const std::lock_guard hold(lock);
    switch (setup.request) {
      case 0x11:
        mask_ = out[12];
        period_ns_ = 1e9 * (1 + (out[8] | out[9] << 8 | out[10] << 16)) / 60e6;
        start_ns_ = clock_.now_ns();
        sent_ = 0;
        running = true;
        return {};
      case 0x12:
        running = false;
        return {};
      case 0x18:
        if (refuses_rest) return {UsbStatus::stall, {}};
        resting_at = setup.value;
        return {};
      case 0x1A:
        output_running = true;
        return {};
      case 0x1B:
        output_running = false;
        return {};
      case 0x30: {
        Bytes memory;
        const float constants[2] = {1.0F, 0.0F};
        for (int i = 0; i < setup.length / 8; ++i) {
          const auto* bytes = reinterpret_cast<const std::uint8_t*>(constants);
          memory.insert(memory.end(), bytes, bytes + 8);
        }
        return {UsbStatus::ok, memory};
      }
      case 0x44:
        return {UsbStatus::ok,
                {static_cast<std::uint8_t>((running ? 2 : 0) | (output_running ? 8 : 0)), 0}};
      case 0x48:
        return {UsbStatus::ok, Bytes(serial_.begin(), serial_.end())};
      default:
        return {};
    }
  }
  UsbStatus out(std::uint8_t, std::span<const std::uint8_t> bytes) override {
    const std::lock_guard hold(lock);
    if (output_stalled) return UsbStatus::stall;
    for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
      driven.push_back(bytes[i] | bytes[i + 1] << 8);
    }
    return UsbStatus::ok;
  }
  UsbAnswer in(std::uint8_t, std::size_t) override {
    const std::lock_guard hold(lock);
    if (stalled) return {UsbStatus::stall, {}};
    if (!running) return {UsbStatus::not_ready, {}};
    const double due = static_cast<double>(sent_ + 32) * period_ns_;
    if (static_cast<double>(clock_.now_ns() - start_ns_) < due) return {UsbStatus::not_ready, {}};
    std::vector<unsigned> channels;
    for (unsigned c = 0; c < 8; ++c) {
      if ((mask_ >> c & 1) != 0) channels.push_back(c);
    }
    Bytes packet;
    for (int i = 0; i < 32; ++i, ++sent_) {
      const unsigned code = 2048 + 100 * channels[sent_ % channels.size()];
      packet.push_back(static_cast<std::uint8_t>(code));
      packet.push_back(static_cast<std::uint8_t>(code >> 8U));
    }
    return {UsbStatus::ok, packet};
  }
  void clear_halt(std::uint8_t endpoint) override {
    const std::lock_guard hold(lock);
    (endpoint == 0x81 ? stalled : output_stalled) = false;
  }
  void overrun() {
    const std::lock_guard hold(lock);
    running = false;
    stalled = true;
  }
  void underrun() {
    const std::lock_guard hold(lock);
    output_running = false;
    output_stalled = true;
  }
  void stop() { running = output_running = stalled = output_stalled = false; }

  std::mutex lock;
  bool running = false;
  bool output_running = false;
  bool stalled = false;
  bool output_stalled = false;
  bool refuses_rest = false;
  int resting_at = -1;
  std::vector<int> driven;

 private:
  std::string serial_;
  MonotonicHostClock clock_;
  int mask_ = 0;
  double period_ns_ = 1.0;
  std::int64_t start_ns_ = 0;
  std::size_t sent_ = 0;
};

struct Usb1208fsPlus : testing::Test {
  emulated::EmulatedBus bus;
  FakeBoard board;
  MonotonicHostClock clock;
  config::Usb1208fsPlus settings;
  config::BenchInputs inputs;
  std::optional<Usb1208fsPlusDriver> driver;

  Usb1208fsPlus() {
    for (std::size_t i = 0; i < 5; ++i) {
      inputs[i] =
          config::BenchInput{"usb_1208fs_plus", "CH" + std::to_string(4 - i), 10.0, false, 1};
    }
    bus.plug(board, 2);
    driver.emplace(settings, inputs, 1000.0, clock);
  }
  void begin() {
    const Result opened = driver->open();
    ASSERT_TRUE(opened) << opened.message;
    const Result started = driver->start();
    ASSERT_TRUE(started) << started.message;
  }
  /// The next outcome that is not no_data.
  Result next(Frame& frame) {
    for (int i = 0; i < 100; ++i) {
      const Result result = driver->read(frame);
      if (result.outcome != Outcome::no_data) return result;
    }
    return {Outcome::no_data, "nothing came"};
  }
};

TEST_F(Usb1208fsPlus, ReturnsEveryScanInOrderInVolts) {
  begin();
  EXPECT_EQ(driver->description().name, "USB-1208FS-Plus #01A2B3C4");
  EXPECT_EQ(driver->description().channels, 0x1F);
  std::int64_t last_ns = 0;
  for (std::uint64_t i = 0; i < 100; ++i) {
    Frame frame;
    const Result result = next(frame);
    ASSERT_TRUE(result) << result.message;
    EXPECT_EQ(frame.sequence, i);
    EXPECT_EQ(frame.valid, 0x1F);
    EXPECT_NEAR(frame[Channel::displacement], 4 * 100 * 10.0 / 2048, 1e-9);
    EXPECT_NEAR(frame[Channel::base_displacement], 0.0, 1e-9);
    EXPECT_EQ(frame.age_us[0], 0);
    EXPECT_EQ(frame.age_us[4], 800);
    if (i > 0) {
      EXPECT_EQ(frame.time_ns - last_ns, 1'000'000);
    }
    last_ns = frame.time_ns;
  }
  driver->stop();
  driver->close();
  EXPECT_FALSE(board.running);
  EXPECT_EQ(bus.open_handles(), 0);
  EXPECT_THAT(bus.misuses(), IsEmpty());
}

TEST_F(Usb1208fsPlus, OverrunIsReportedOnceAndTheSequenceJumps) {
  begin();
  Frame frame;
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(next(frame));
  const std::int64_t before_ns = clock.now_ns();
  const std::uint64_t before = frame.sequence;
  board.overrun();
  Result result;
  while ((result = next(frame))) {
  }
  EXPECT_EQ(result.outcome, Outcome::temporary);
  EXPECT_THAT(result.message, HasSubstr("overran"));
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(next(frame));
  const auto elapsed_ms = static_cast<double>(clock.now_ns() - before_ns) * 1e-6;
  EXPECT_NEAR(static_cast<double>(frame.sequence - before), elapsed_ms, 20.0);
  EXPECT_EQ(driver->overruns(), 1U);
  // Counters persist after close.
  driver->close();
  const Counts counts = driver->counts();
  ASSERT_EQ(counts.all().size(), 2U);
  EXPECT_STREQ(counts.all()[0].device, "USB-1208FS-Plus");
  EXPECT_STREQ(counts.all()[0].name, "overruns");
  EXPECT_EQ(counts.all()[0].value, 1U);
  EXPECT_STREQ(counts.all()[1].name, "underruns");
  EXPECT_EQ(counts.all()[1].value, 0U);
}

TEST_F(Usb1208fsPlus, DrivesOneValuePerFrameAndRestsImmediately) {
  begin();
  Frame frame;
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(next(frame));
  const int first = 1000;
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(driver->write({(first + i) * 5.0 / 4096.0, true}));
    ASSERT_TRUE(next(frame));
  }
  {
    const std::lock_guard hold(board.lock);
    EXPECT_TRUE(board.output_running);
    // 20 ms ahead, plus one value per frame except those in flight.
    ASSERT_GT(board.driven.size(), 20U + 60U);
    EXPECT_LE(board.driven.size(), 20U + 100U);
    const auto rising = board.driven.begin() + 20;
    EXPECT_TRUE(std::is_sorted(rising, board.driven.end()));
    EXPECT_LT(board.driven.back() - *rising, 100);
  }
  ASSERT_TRUE(driver->write({2.0, false}));
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(next(frame));
  const std::lock_guard hold(board.lock);
  EXPECT_FALSE(board.output_running);
  EXPECT_EQ(board.resting_at, 1638);
}

TEST_F(Usb1208fsPlus, OutputNotAtRestAfterStopIsReported) {
  begin();
  ASSERT_TRUE(driver->write({3.0, true}));
  Frame frame;
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(next(frame));
  driver->stop();
  EXPECT_EQ(driver->left_on(), nullptr);
  ASSERT_TRUE(driver->start());
  ASSERT_TRUE(driver->write({3.0, true}));
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(next(frame));
  {
    const std::lock_guard hold(board.lock);
    board.refuses_rest = true;
  }
  driver->stop();
  ASSERT_NE(driver->left_on(), nullptr);
  EXPECT_THAT(driver->left_on(), HasSubstr("01A2B3C4"));
  EXPECT_THAT(driver->left_on(), HasSubstr("press the emergency stop"));
}

TEST_F(Usb1208fsPlus, OutputRestartsAfterAnUnderrun) {
  begin();
  Frame frame;
  bool reported = false;
  for (int i = 0; i < 200 && !reported; ++i) {
    ASSERT_TRUE(next(frame));
    if (i == 30) board.underrun();
    const Result written = driver->write({2.5, true});
    reported = written.outcome == Outcome::temporary;
    if (reported) {
      EXPECT_THAT(written.message, HasSubstr("ran dry"));
    }
  }
  EXPECT_TRUE(reported);
  EXPECT_EQ(driver->underruns(), 1U);
  // With values written after the loop has caught up.
  const auto runs = [this] {
    const std::lock_guard hold(board.lock);
    return board.output_running;
  };
  for (int i = 0; i < 500 && !runs(); ++i) {
    ASSERT_TRUE(next(frame));
    static_cast<void>(driver->write({2.5, true}));
  }
  EXPECT_TRUE(runs());
}

TEST_F(Usb1208fsPlus, IsLostInEveryState) {
  ASSERT_TRUE(driver->open());
  bus.unplug(board);
  EXPECT_EQ(driver->start().outcome, Outcome::lost);
  driver->close();
  EXPECT_EQ(driver->open().outcome, Outcome::lost);
  bus.plug(board, 2);
  begin();
  Frame frame;
  ASSERT_TRUE(next(frame));
  ASSERT_TRUE(driver->write({2.5, true}));
  bus.unplug(board);
  Result result;
  while ((result = next(frame))) {
  }
  EXPECT_EQ(result.outcome, Outcome::lost);
  EXPECT_EQ(driver->write({2.5, true}).outcome, Outcome::lost);
  driver->stop();
  driver->close();
  EXPECT_EQ(bus.open_handles(), 0);
  EXPECT_EQ(bus.transfers_in_flight(), 0U);
  EXPECT_THAT(bus.misuses(), IsEmpty());
}

TEST_F(Usb1208fsPlus, RestsAtTheConfiguredVoltageBeforeAnyWrite) {
  settings.rest_v = 1.0;
  driver.emplace(settings, inputs, 1000.0, clock);
  begin();
  Frame frame;
  ASSERT_TRUE(next(frame));
  driver->stop();
  EXPECT_EQ(board.resting_at, 819);
}

TEST_F(Usb1208fsPlus, TransfersKeptByTheKernelDoNotBlockStop) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "memory kept by the kernel is never freed, which the address sanitizer reports";
#endif
  begin();
  Frame frame;
  ASSERT_TRUE(next(frame));
  {
    const std::lock_guard hold(board.lock);
    board.running = false;  // no more data
  }
  kernel_keeps = true;
  const std::int64_t start_ns = clock.now_ns();
  driver->stop();
  EXPECT_LT(clock.now_ns() - start_ns, 4'000'000'000);
  EXPECT_EQ(driver->start().outcome, Outcome::lost);
  driver->close();
  EXPECT_EQ(bus.open_handles(), 1) << "the handle is left to the kernel";
  kernel_keeps = false;
  begin();
  ASSERT_TRUE(next(frame));
}

TEST_F(Usb1208fsPlus, FailingEventHandlingDoesNotSpin) {
  begin();
  events_fail = true;
  const int before = events_handled;
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  const int handled = events_handled - before;
  events_fail = false;
  EXPECT_LT(handled, 200);
}

TEST_F(Usb1208fsPlus, RefusalsReportTheRemedy) {
  bus.refuse_access(board);
  Result refused = driver->open();
  EXPECT_EQ(refused.outcome, Outcome::needs_attention);
  EXPECT_THAT(refused.message, HasSubstr("70-stickslip.rules gives it to the group stickslip"));
  ASSERT_EQ(find_usb_1208fs_plus().size(), 1U);
  EXPECT_THAT(find_usb_1208fs_plus()[0].problem, HasSubstr("udev"));
  bus.refuse_access(board, false);
  EXPECT_THAT(find_usb_1208fs_plus()[0].problem, IsEmpty());
  EXPECT_EQ(find_usb_1208fs_plus()[0].location, "USB 1-2");
  FakeBoard other("0FFFFFFF");
  bus.plug(other, 4);
  refused = driver->open();
  EXPECT_EQ(refused.outcome, Outcome::needs_attention);
  EXPECT_THAT(refused.message,
              HasSubstr("several USB-1208FS-Plus are attached (01A2B3C4, 0FFFFFFF)"));
  bus.unplug(other);
  settings.serial = "00000000";
  driver.emplace(settings, inputs, 1000.0, clock);
  EXPECT_THAT(driver->open().message,
              HasSubstr("USB-1208FS-Plus #00000000 is not attached. Attached: 01A2B3C4"));
}

}  // namespace
}  // namespace stickslip::drivers
