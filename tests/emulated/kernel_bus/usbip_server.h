// SPDX-License-Identifier: Apache-2.0
// An emulated USB device on the kernel's own bus: the virtual host controller (vhci-hcd) uses one
// end of a socket pair, and its requests are served at the other (kernel documentation,
// usb/usbip_protocol). Needs root and the module vhci-hcd.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "tests/emulated/usb_device.h"

namespace stickslip::emulated {

/// Serves one device in a separate thread. All calls from one other thread.
class UsbipServer {
 public:
  /// `port`: one of the controller's first eight, for one device at a time. `poll_ms`: poll period
  /// of a device without data.
  UsbipServer(UsbDevice& device, int port, int poll_ms = 1)
      : device_(device), port_(port), poll_ms_(poll_ms) {}
  ~UsbipServer() { unplug(); }
  UsbipServer(const UsbipServer&) = delete;
  UsbipServer& operator=(const UsbipServer&) = delete;

  /// True if there is a virtual controller.
  static bool available();

  /// Resets the device and attaches it to the bus. Throws std::runtime_error on failure.
  void plug();
  /// Detaches the device immediately, also during transfers.
  void unplug();
  bool plugged() const { return thread_.joinable(); }

  /// The firmware hangs: the device is attached without replies, until it is plugged in again.
  void hang() { hangs_ = true; }
  /// True if the hung device has received a request. Unplugging then interrupts a transfer, which a
  /// virtual controller, unlike a real one, does not return: the kernel waits for it, as for one
  /// that hangs, for five seconds.
  bool has_unserved_request() const { return has_unserved_request_; }

 private:
  struct Request {
    std::uint32_t number = 0;
    bool in = false;
    std::uint8_t endpoint = 0;
    std::uint32_t length = 0;
    UsbSetup setup;
    Bytes data;
  };

  void serve();
  bool take(int timeout_ms);
  void serve_requests();
  std::optional<UsbAnswer> try_request(const Request& request);
  UsbAnswer control(const Request& request);
  UsbAnswer descriptor(const UsbSetup& setup) const;
  bool reply(const Request& request, const UsbAnswer& answer);

  UsbDevice& device_;
  int port_;
  int poll_ms_;
  int socket_ = -1;
  std::atomic<bool> hangs_{false};
  std::atomic<bool> has_unserved_request_{false};
  std::thread thread_;
  std::map<std::uint8_t, std::deque<Request>> waiting_;  // by endpoint address
};

}  // namespace stickslip::emulated
