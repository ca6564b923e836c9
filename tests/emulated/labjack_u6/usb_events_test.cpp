// SPDX-License-Identifier: Apache-2.0
// Waiting for USB transfers does not occupy the processor, even if libusb returns immediately.
#include "drivers/usb/usb_events.h"

#include <gtest/gtest.h>

#include "tests/emulated/attach/emulated_bus.h"

namespace stickslip::emulated {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

class UsbEventsBench : public testing::Test {
 protected:
  UsbEventsBench() { libusb_init(&context_); }
  ~UsbEventsBench() override { libusb_exit(context_); }

  /// Duration of a number of waits of 50 ms that return immediately without an event.
  Clock::duration spurious_waits(int times) {
    const Clock::time_point start = Clock::now();
    for (int i = 0; i < times; ++i) {
      libusb_interrupt_event_handler(context_);
      EXPECT_TRUE(events_.handle(context_, milliseconds(50)));
    }
    return Clock::now() - start;
  }

  EmulatedBus bus_;
  libusb_context* context_ = nullptr;
  drivers::UsbEvents events_;
};

// As between the unplugging of a board and its removal by the kernel.
TEST_F(UsbEventsBench, ContinuouslyReadyBoardIsPolledOncePerMillisecond) {
  EXPECT_GE(spurious_waits(60), milliseconds(49));
}

TEST_F(UsbEventsBench, WaitsForTheTimeout) {
  spurious_waits(5);
  const Clock::time_point start = Clock::now();
  EXPECT_TRUE(events_.handle(context_, milliseconds(20)));
  EXPECT_GE(Clock::now() - start, milliseconds(19));
}

}  // namespace
}  // namespace stickslip::emulated
