// SPDX-License-Identifier: Apache-2.0
// A USB bus inside a test program: devices are plugged and unplugged, and are found by the
// replacements of libusb and hidapi that the program is linked with.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tests/emulated/usb_device.h"

namespace stickslip::emulated {

class BusState;

/// The bus of the program during its life; a second one at the same time throws. Without one, the
/// library replacements find no devices. A separate thread transfers data like a host controller,
/// independently of event handling. Any thread may call it.
class EmulatedBus {
 public:
  EmulatedBus();
  EmulatedBus(const EmulatedBus&) = delete;
  EmulatedBus& operator=(const EmulatedBus&) = delete;
  /// Unplugs everything.
  ~EmulatedBus();

  /// Resets the device, as by power. It must live until it is unplugged.
  void plug(UsbDevice& device, std::uint8_t port);
  /// Pending requests and all later calls end with "no device".
  void unplug(UsbDevice& device);

  /// As without a udev rule, for handles opened from now on.
  void refuse_access(UsbDevice& device, bool refuse = true);
  /// A kernel driver claims its interface until it is detached.
  void hold_by_kernel_driver(UsbDevice& device);

  /// Runs an action while the bus is idle, for access of a test to a device.
  void between_calls(const std::function<void()>& action);

  /// Number of open handles, also of unplugged devices.
  int open_handles() const;
  /// Transfers submitted and not yet completed by a callback.
  std::size_t transfers_in_flight() const;
  /// Those of them that wait for their device: not those that have ended, whose callback is due.
  std::size_t transfers_waiting() const;
  /// Descriptions of misuse of the real library: a handle closed with transfers in flight, a
  /// transfer freed in flight, an interface not claimed.
  std::vector<std::string> misuses() const;

 private:
  std::shared_ptr<BusState> state_;
};

}  // namespace stickslip::emulated
