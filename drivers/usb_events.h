// Waiting for what USB transfers do, in a thread that may have a real-time priority.
#pragma once

#include <libusb-1.0/libusb.h>

#include <chrono>

namespace stickslip::drivers {

/// For one thread. A board that is being unplugged makes its file ready without end, from when the
/// kernel has marked it until a thread of the kernel has taken it away; libusb then returns at once
/// and has nothing to tell. At a real-time priority that thread would not run until the scheduler
/// throttles this one: measured, a second in which nothing else ran on its processor. So after a
/// few returns for nothing each is followed by a nap.
class UsbEvents {
 public:
  /// Every callback of a transfer says so.
  void heard() { heard_ = true; }

  /// Handles what has come, and waits for it for so long at most. False where libusb failed; then
  /// it has napped as well.
  bool handle(libusb_context* context, std::chrono::microseconds patience);

 private:
  bool heard_ = false;
  int for_nothing_ = 0;
};

}  // namespace stickslip::drivers
