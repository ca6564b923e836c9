#include "drivers/usb_events.h"

#include <thread>

namespace stickslip::drivers {

namespace {
constexpr int returns_for_nothing = 10;
constexpr std::chrono::milliseconds nap{1};
}  // namespace

bool UsbEvents::handle(libusb_context* context, std::chrono::microseconds patience) {
  using Clock = std::chrono::steady_clock;
  heard_ = false;
  const Clock::time_point begun = Clock::now();
  timeval left{0, static_cast<suseconds_t>(patience.count())};
  const int error = libusb_handle_events_timeout_completed(context, &left, nullptr);
  if (error != LIBUSB_SUCCESS && error != LIBUSB_ERROR_INTERRUPTED) {
    std::this_thread::sleep_for(nap);
    return false;
  }
  const bool for_nothing = !heard_ && Clock::now() - begun < patience / 2;
  for_nothing_ = for_nothing ? for_nothing_ + 1 : 0;
  if (for_nothing_ > returns_for_nothing) std::this_thread::sleep_for(nap);
  return true;
}

}  // namespace stickslip::drivers
