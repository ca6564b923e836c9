// An emulated USB device on the kernel's own bus: the virtual host controller (vhci-hcd) is given
// one end of a socket pair, and what its stack asks of the device is answered at the other (the
// kernel's documentation, usb/usbip_protocol). Needs root, and the module vhci-hcd.
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

/// Serves one device in a thread of its own. The rest is for one other thread.
class UsbipServer {
 public:
  /// `port`: one of the controller's first eight, each for one device at a time. `poll_ms`: how
  /// often a device that has nothing to say is asked again.
  UsbipServer(UsbDevice& device, int port, int poll_ms = 1)
      : device_(device), port_(port), poll_ms_(poll_ms) {}
  ~UsbipServer() { unplug(); }
  UsbipServer(const UsbipServer&) = delete;
  UsbipServer& operator=(const UsbipServer&) = delete;

  /// Whether there is a virtual controller.
  static bool available();

  /// The device is reset and appears on the bus. Throws std::runtime_error where it cannot.
  void plug();
  /// Gone at once, in the middle of whatever is under way.
  void unplug();
  bool plugged() const { return thread_.joinable(); }

  /// Its firmware hangs: it is there, and answers nothing, until it is plugged in again.
  void hang() { hangs_ = true; }
  /// Whether one that hangs has been asked something since. A cable that is pulled then is pulled
  /// in the middle of a transfer, which a virtual controller, other than a real one, does not give
  /// back: the kernel waits for it as long as for one that hangs, five seconds.
  bool asked_in_vain() const { return asked_in_vain_; }

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
  void answer_what_can_be();
  std::optional<UsbAnswer> try_request(const Request& request);
  UsbAnswer control(const Request& request);
  UsbAnswer descriptor(const UsbSetup& setup) const;
  bool reply(const Request& request, const UsbAnswer& answer);

  UsbDevice& device_;
  int port_;
  int poll_ms_;
  int socket_ = -1;
  std::atomic<bool> hangs_{false};
  std::atomic<bool> asked_in_vain_{false};
  std::thread thread_;
  std::map<std::uint8_t, std::deque<Request>> waiting_;  // by endpoint address
};

}  // namespace stickslip::emulated
