// SPDX-License-Identifier: Apache-2.0
// Connection to one USB-1208FS-Plus: discovery, and control requests.
#pragma once

#include <libusb-1.0/libusb.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "drivers/attached_device.h"
#include "drivers/driver.h"
#include "drivers/usb/usb_boards.h"
#include "drivers/usb_1208fs_plus/protocol.h"

namespace stickslip::drivers::usb_1208fs_plus {

/// Members are ordered so that the handle is closed before its context.
class Session {
 public:
  /// Opens the wanted board. `refusal` holds the message unless the outcome is ok.
  Outcome open(const WantedUsbBoard& wanted, std::string& refusal);

  libusb_context* context() const { return context_.get(); }
  libusb_device_handle* handle() const { return handle_.get(); }
  const std::string& serial() const { return serial_; }
  /// Releases the board for another session, which also ends pending transfers of the kernel.
  void release() const;

  /// Control requests; they wait at most a second. Negative: libusb's error.
  int send(Request request, std::span<const std::uint8_t> bytes = {}, std::uint16_t value = 0,
           std::uint16_t index = 0) const;
  int receive(Request request, std::span<std::uint8_t> bytes, std::uint16_t value = 0) const;

 private:
  UsbContext context_;
  UsbHandle handle_;
  std::string serial_;
};

std::vector<AttachedDevice> find_all();

}  // namespace stickslip::drivers::usb_1208fs_plus
