// SPDX-License-Identifier: Apache-2.0
// Waiting for USB transfer events, in a thread that may have a real-time priority.
#pragma once

#include <libusb-1.0/libusb.h>

#include <chrono>

namespace stickslip::drivers {

/// For one thread. While a board is being unplugged, its file is ready continuously, until a kernel
/// thread has removed the device; libusb then returns immediately without an event. At a real-time
/// priority that kernel thread would not run until the scheduler throttles this one: measured, one
/// second in which nothing else ran on that processor. So after a few idle returns, each further
/// one is followed by a sleep.
class UsbEvents {
 public:
  /// To be called by every transfer callback.
  void note_callback() { callback_ran_ = true; }

  /// Handles events, and waits for one at most `timeout`. False if libusb failed, also after a
  /// sleep.
  bool handle(libusb_context* context, std::chrono::microseconds timeout);

 private:
  bool callback_ran_ = false;
  int idle_returns_ = 0;
};

}  // namespace stickslip::drivers
