// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/attach/emulated_libusb.h"

#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <libusb-1.0/libusb.h>

#include <array>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <thread>
#include <vector>

#include "tests/emulated/labjack_u6/emulated_labjack_u6.h"

namespace stickslip::emulated {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;

class ConstantWires final : public Wires {
 public:
  double truth(Channel, std::int64_t) override { return 1.0; }
  void drive(double, std::int64_t) override {}
  void enable(bool, std::int64_t) override {}
};

/// The program or library that provides a function.
std::filesystem::path file_of(void* function) {
  Dl_info info{};
  return dladdr(function, &info) != 0 ? std::filesystem::canonical(info.dli_fname) : "";
}

TEST(EmulatedLibusbLink, ProgramLinksTheEmulation) {
  const auto program = std::filesystem::canonical("/proc/self/exe");
  EXPECT_EQ(file_of(reinterpret_cast<void*>(&libusb_init)), program);
  EXPECT_EQ(file_of(reinterpret_cast<void*>(&libusb_submit_transfer)), program);
  EXPECT_EQ(file_of(reinterpret_cast<void*>(&libusb_handle_events_timeout_completed)), program);
  EXPECT_EQ(file_of(reinterpret_cast<void*>(&libusb_control_transfer)), program);
  // The program is linked with it, but uses none of its functions.
  EXPECT_EQ(dlopen("libusb-1.0.so.0", RTLD_NOW | RTLD_NOLOAD), nullptr);
  EXPECT_STREQ(libusb_get_version()->describe, "emulated");
}

TEST(EmulatedLibusbLink, WithoutABusThereIsNoDevice) {
  libusb_context* context = nullptr;
  ASSERT_EQ(libusb_init(&context), 0);
  libusb_device** list = nullptr;
  EXPECT_EQ(libusb_get_device_list(context, &list), 0);
  libusb_free_device_list(list, 1);
  libusb_exit(context);
}

struct Transfer {
  libusb_transfer* transfer = libusb_alloc_transfer(0);
  std::vector<unsigned char> buffer;
  std::vector<int> completions;
  std::thread::id thread;

  Transfer(libusb_device_handle* handle, unsigned char endpoint, std::size_t size,
           unsigned timeout_ms = 0)
      : buffer(size) {
    libusb_fill_bulk_transfer(transfer, handle, endpoint, buffer.data(), static_cast<int>(size),
                              &Transfer::ended, this, timeout_ms);
  }
  Transfer(const Transfer&) = delete;
  Transfer& operator=(const Transfer&) = delete;
  ~Transfer() { libusb_free_transfer(transfer); }
  static void ended(libusb_transfer* transfer) {
    auto& self = *static_cast<Transfer*>(transfer->user_data);
    self.completions.push_back(transfer->status);
    self.thread = std::this_thread::get_id();
  }
};

struct EmulatedLibusb : testing::Test {
  EmulatedBus bus;
  ConstantWires wires;
  std::atomic<std::int64_t> now_ns = 0;
  EmulatedLabjackU6 u6{wires, [this] { return now_ns.load(); }};
  libusb_context* context = nullptr;
  libusb_device_handle* handle = nullptr;

  void SetUp() override {
    bus.plug(u6, 3);
    ASSERT_EQ(libusb_init(&context), 0);
    handle = libusb_open_device_with_vid_pid(context, 0x0CD5, 6);
    ASSERT_NE(handle, nullptr);
    ASSERT_EQ(libusb_claim_interface(handle, 0), 0);
  }
  void TearDown() override {
    if (handle != nullptr) libusb_close(handle);
    libusb_exit(context);
  }
  void handle_events(int milliseconds = 50) {
    timeval tv{0, milliseconds * 1000};
    ASSERT_EQ(libusb_handle_events_timeout_completed(context, &tv, nullptr), 0);
  }
  Bytes request(Bytes command, int* error = nullptr) {
    int moved = 0;
    int result = libusb_bulk_transfer(handle, 0x01, command.data(),
                                      static_cast<int>(command.size()), &moved, 1000);
    Bytes reply(64);
    if (result == 0) result = libusb_bulk_transfer(handle, 0x82, reply.data(), 64, &moved, 20);
    if (error != nullptr) *error = result;
    reply.resize(static_cast<std::size_t>(result == 0 ? moved : 0));
    return reply;
  }
  /// 1 kHz of AIN0, 25 samples to a packet.
  void start_stream() {
    Bytes config = {0, 0xF8, 5, 0x11, 0, 0, 1, 0, 25, 0, 0, 0, 0xA0, 0x0F, 0, 0};
    unsigned sum = 0;
    for (std::size_t i = 6; i < config.size(); ++i) sum += config[i];
    config[4] = static_cast<std::uint8_t>(sum);
    config[5] = static_cast<std::uint8_t>(sum / 256);
    unsigned head = config[1] + config[2] + config[3] + config[4] + unsigned{config[5]};
    head = head / 256 + head % 256;
    config[0] = static_cast<std::uint8_t>(head / 256 + head % 256);
    ASSERT_EQ(request(config).at(6), 0);
    ASSERT_EQ(request({0xA8, 0xA8}).at(2), 0);
  }
};

TEST_F(EmulatedLibusb, ListsAttachedDevices) {
  libusb_device** list = nullptr;
  ASSERT_EQ(libusb_get_device_list(context, &list), 1);
  libusb_device_descriptor descriptor{};
  ASSERT_EQ(libusb_get_device_descriptor(list[0], &descriptor), 0);
  EXPECT_EQ(descriptor.idVendor, 0x0CD5);
  EXPECT_EQ(descriptor.idProduct, 6);
  EXPECT_EQ(descriptor.bNumConfigurations, 1);
  std::array<std::uint8_t, 7> ports{};
  ASSERT_EQ(libusb_get_port_numbers(list[0], ports.data(), 7), 1);
  EXPECT_EQ(ports[0], 3);
  libusb_config_descriptor* config = nullptr;
  ASSERT_EQ(libusb_get_active_config_descriptor(list[0], &config), 0);
  ASSERT_EQ(config->interface[0].altsetting[0].bNumEndpoints, 3);
  EXPECT_EQ(config->interface[0].altsetting[0].endpoint[1].bEndpointAddress, 0x82);
  EXPECT_EQ(config->interface[0].altsetting[0].endpoint[1].wMaxPacketSize, 64);
  libusb_free_config_descriptor(config);
  libusb_free_device_list(list, 1);
  std::array<unsigned char, 64> text{};
  EXPECT_EQ(libusb_get_string_descriptor_ascii(handle, 2, text.data(), 64), 10);
  EXPECT_STREQ(reinterpret_cast<char*>(text.data()), "LabJack U6");
  EXPECT_EQ(libusb_get_string_descriptor_ascii(handle, 3, text.data(), 64), LIBUSB_ERROR_PIPE);
  EXPECT_EQ(libusb_has_capability(LIBUSB_CAP_HAS_HOTPLUG), 0);
}

TEST_F(EmulatedLibusb, ReportsTheErrorsOfAHost) {
  libusb_device* device = libusb_get_device(handle);
  libusb_device_handle* other = nullptr;
  ASSERT_EQ(libusb_open(device, &other), 0);
  EXPECT_EQ(libusb_claim_interface(other, 0), LIBUSB_ERROR_BUSY);
  libusb_release_interface(handle, 0);
  bus.hold_by_kernel_driver(u6);
  EXPECT_EQ(libusb_claim_interface(other, 0), LIBUSB_ERROR_BUSY);
  EXPECT_EQ(libusb_kernel_driver_active(other, 0), 1);
  libusb_set_auto_detach_kernel_driver(other, 1);
  EXPECT_EQ(libusb_claim_interface(other, 0), 0);
  EXPECT_EQ(bus.open_handles(), 2);
  libusb_close(other);
  bus.refuse_access(u6);
  EXPECT_EQ(libusb_open(device, &other), LIBUSB_ERROR_ACCESS);
  EXPECT_THROW(EmulatedBus(), std::logic_error);
}

TEST_F(EmulatedLibusb, SynchronousTransfersCompleteAndTimeOut) {
  EXPECT_THAT(request({0xB0, 0xB0}), ElementsAre(0xE5, 0xB1, 52, 0));
  int error = 0;
  u6.schedule(U6ReplyFault::missing);
  request({0xB0, 0xB0}, &error);
  EXPECT_EQ(error, LIBUSB_ERROR_TIMEOUT);
  u6.schedule(U6ReplyFault::stall);
  request({0xB0, 0xB0}, &error);
  EXPECT_EQ(error, LIBUSB_ERROR_PIPE);
  EXPECT_EQ(libusb_clear_halt(handle, 0x82), 0);
  Bytes reply(64);
  int moved = 0;
  EXPECT_EQ(libusb_bulk_transfer(handle, 0x82, reply.data(), 64, &moved, 100), 0);
  EXPECT_EQ(moved, 4);
  EXPECT_EQ(libusb_control_transfer(handle, 0xC0, 1, 0, 0, reply.data(), 8, 100),
            LIBUSB_ERROR_PIPE);
  EXPECT_EQ(libusb_bulk_transfer(handle, 0x85, reply.data(), 64, &moved, 100), LIBUSB_ERROR_IO);
}

TEST_F(EmulatedLibusb, CallbacksRunOnlyDuringEventHandling) {
  start_stream();
  Transfer transfer(handle, 0x83, 64);
  ASSERT_EQ(libusb_submit_transfer(transfer.transfer), 0);
  EXPECT_EQ(libusb_submit_transfer(transfer.transfer), LIBUSB_ERROR_BUSY);
  now_ns = 30'000'000;
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_THAT(transfer.completions, IsEmpty());
  EXPECT_EQ(bus.transfers_in_flight(), 1U);
  handle_events();
  EXPECT_THAT(transfer.completions, ElementsAre(LIBUSB_TRANSFER_COMPLETED));
  EXPECT_EQ(transfer.transfer->actual_length, 64);
  EXPECT_EQ(transfer.thread, std::this_thread::get_id());
  EXPECT_EQ(bus.transfers_in_flight(), 0U);
}

TEST_F(EmulatedLibusb, ATransferOfManyPacketsWaitsUntilItIsFull) {
  start_stream();
  Transfer first(handle, 0x83, 128);
  Transfer second(handle, 0x83, 64);
  libusb_submit_transfer(first.transfer);
  libusb_submit_transfer(second.transfer);
  now_ns = 30'000'000;
  handle_events(10);
  EXPECT_THAT(first.completions, IsEmpty());
  EXPECT_THAT(second.completions, IsEmpty());
  now_ns = 80'000'000;
  while (second.completions.empty()) handle_events(10);
  EXPECT_EQ(first.transfer->actual_length, 128);
  EXPECT_EQ(first.buffer[10], 0);
  EXPECT_EQ(first.buffer[74], 1);
  EXPECT_EQ(second.buffer[10], 2);
}

TEST_F(EmulatedLibusb, CancelledAndTimedOutTransfersEndLater) {
  start_stream();
  Transfer cancelled(handle, 0x83, 64);
  Transfer timed(handle, 0x82, 64, 5);
  libusb_submit_transfer(cancelled.transfer);
  libusb_submit_transfer(timed.transfer);
  ASSERT_EQ(libusb_cancel_transfer(cancelled.transfer), 0);
  EXPECT_THAT(cancelled.completions, IsEmpty());
  while (cancelled.completions.empty() || timed.completions.empty()) handle_events(10);
  EXPECT_THAT(cancelled.completions, ElementsAre(LIBUSB_TRANSFER_CANCELLED));
  EXPECT_THAT(timed.completions, ElementsAre(LIBUSB_TRANSFER_TIMED_OUT));
  EXPECT_EQ(libusb_cancel_transfer(cancelled.transfer), LIBUSB_ERROR_NOT_FOUND);
}

TEST_F(EmulatedLibusb, AStallLastsUntilItIsCleared) {
  start_stream();
  u6.schedule(U6StreamFault::stall, 0);
  Transfer transfer(handle, 0x83, 64);
  libusb_submit_transfer(transfer.transfer);
  now_ns = 30'000'000;
  while (transfer.completions.empty()) handle_events(10);
  EXPECT_THAT(transfer.completions, ElementsAre(LIBUSB_TRANSFER_STALL));
  libusb_clear_halt(handle, 0x83);
  libusb_submit_transfer(transfer.transfer);
  while (transfer.completions.size() < 2) handle_events(10);
  EXPECT_EQ(transfer.completions[1], LIBUSB_TRANSFER_COMPLETED);
}

TEST_F(EmulatedLibusb, UnpluggedDevicesDisappear) {
  start_stream();
  Transfer transfer(handle, 0x83, 64);
  libusb_submit_transfer(transfer.transfer);
  bus.unplug(u6);
  handle_events();
  EXPECT_THAT(transfer.completions, ElementsAre(LIBUSB_TRANSFER_NO_DEVICE));
  EXPECT_EQ(libusb_submit_transfer(transfer.transfer), LIBUSB_ERROR_NO_DEVICE);
  int error = 0;
  request({0xB0, 0xB0}, &error);
  EXPECT_EQ(error, LIBUSB_ERROR_NO_DEVICE);
  bus.plug(u6, 3);
  request({0xB0, 0xB0}, &error);
  EXPECT_EQ(error, LIBUSB_ERROR_NO_DEVICE) << "a handle stays invalid";
  EXPECT_FALSE(u6.streaming());
  libusb_close(handle);
  handle = libusb_open_device_with_vid_pid(context, 0x0CD5, 6);
  ASSERT_NE(handle, nullptr);
  EXPECT_THAT(bus.misuses(), IsEmpty());
}

TEST_F(EmulatedLibusb, AnotherThreadEndsTheWait) {
  const auto start = std::chrono::steady_clock::now();
  std::thread other([this] {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    libusb_interrupt_event_handler(context);
  });
  libusb_handle_events(context);
  other.join();
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
}

TEST_F(EmulatedLibusb, RecordsMisuseOfTheLibrary) {
  start_stream();
  Transfer transfer(handle, 0x83, 64);
  libusb_submit_transfer(transfer.transfer);
  libusb_close(handle);
  handle = nullptr;
  EXPECT_THAT(bus.misuses(), Contains("a handle closed with transfers in flight"));
  EXPECT_EQ(bus.transfers_in_flight(), 0U);
}

}  // namespace
}  // namespace stickslip::emulated
