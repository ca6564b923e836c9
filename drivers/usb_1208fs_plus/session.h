// One USB-1208FS-Plus on the bus: found, opened, claimed, and its control requests.
#pragma once

#include <libusb-1.0/libusb.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "drivers/attached.h"
#include "drivers/driver.h"
#include "drivers/usb_1208fs_plus/protocol.h"
#include "drivers/usb_boards.h"

namespace stickslip::drivers::usb_1208fs_plus {

/// In this order: the handle ends before its context.
class Session {
 public:
  /// The board with that serial number; empty: the only one. `refusal` holds the message where the
  /// outcome is not ok.
  Outcome open(const std::string& serial, std::string& refusal);

  libusb_context* context() const { return context_.get(); }
  libusb_device_handle* handle() const { return handle_.get(); }
  const std::string& serial() const { return serial_; }
  /// Gives the board free for another session. What the kernel still does on it ends with that.
  void release() const;

  /// Control requests. They wait, at most a second. Negative: libusb's error.
  int send(Request request, std::span<const std::uint8_t> bytes = {}, std::uint16_t value = 0,
           std::uint16_t index = 0) const;
  int receive(Request request, std::span<std::uint8_t> bytes, std::uint16_t value = 0) const;

 private:
  UsbContext context_;
  UsbHandle handle_;
  std::string serial_;
};

std::vector<Attached> find_all();

}  // namespace stickslip::drivers::usb_1208fs_plus
