// A host's USB bus inside a test program: devices are plugged in and out, and the stand-ins for
// libusb and hidapi that the program is linked with find them there.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tests/emulated/usb_device.h"

namespace stickslip::emulated {

class BusState;

/// The one bus of the program, for as long as it lives; a second one at the same time is refused by
/// an exception. Without one, the stand-ins find a host without devices. A thread of its own moves
/// data as a host controller does, whether or not anyone handles events. Any thread may call it.
class EmulatedBus {
 public:
  EmulatedBus();
  EmulatedBus(const EmulatedBus&) = delete;
  EmulatedBus& operator=(const EmulatedBus&) = delete;
  /// Unplugs everything.
  ~EmulatedBus();

  /// The device is reset, as by power. It must outlive its stay.
  void plug(UsbDevice& device, std::uint8_t port);
  /// Whatever is under way on it ends with "no device", and so does every later call.
  void unplug(UsbDevice& device);

  /// As where no udev rule gives access. Of handles that are opened from now on.
  void refuse_access(UsbDevice& device, bool refuse = true);
  /// A kernel driver holds its interface until it is detached.
  void hold_by_kernel_driver(UsbDevice& device);

  /// Runs it while the bus stands still: where a test looks at a device, or sets it.
  void between_calls(const std::function<void()>& what);

  /// How many handles are open on devices that are or were plugged in.
  int open_handles() const;
  /// Transfers that were submitted and not yet called back.
  std::size_t transfers_in_flight() const;
  /// What a driver did that the real library would take amiss, in words: a handle closed with
  /// transfers in flight, a transfer freed in flight, an interface not claimed.
  std::vector<std::string> misuses() const;

 private:
  std::shared_ptr<BusState> state_;
};

}  // namespace stickslip::emulated
