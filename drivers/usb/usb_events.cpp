// SPDX-License-Identifier: Apache-2.0
#include "drivers/usb/usb_events.h"

#include <thread>

namespace stickslip::drivers {

namespace {
constexpr int max_idle_returns = 10;
constexpr std::chrono::milliseconds idle_sleep{1};
}  // namespace

bool UsbEvents::handle(libusb_context* context, std::chrono::microseconds timeout) {
  using Clock = std::chrono::steady_clock;
  callback_ran_ = false;
  const Clock::time_point start = Clock::now();
  timeval left{0, static_cast<suseconds_t>(timeout.count())};
  const int error = libusb_handle_events_timeout_completed(context, &left, nullptr);
  if (error != LIBUSB_SUCCESS && error != LIBUSB_ERROR_INTERRUPTED) {
    std::this_thread::sleep_for(idle_sleep);
    return false;
  }
  const bool idle = !callback_ran_ && Clock::now() - start < timeout / 2;
  idle_returns_ = idle ? idle_returns_ + 1 : 0;
  if (idle_returns_ > max_idle_returns) std::this_thread::sleep_for(idle_sleep);
  return true;
}

}  // namespace stickslip::drivers
