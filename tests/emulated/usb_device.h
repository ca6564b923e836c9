// A USB device as the bus sees it: what the emulations of boards and bridges are, and what attaches
// them drives: an in-process stand-in for the driver's library, or the kernel's own stack through
// vhci-hcd. An emulation knows the device, not how it is attached.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace stickslip::emulated {

using Bytes = std::vector<std::uint8_t>;

/// The eight bytes of a control request, in host order.
struct UsbSetup {
  std::uint8_t request_type = 0;
  std::uint8_t request = 0;
  std::uint16_t value = 0;
  std::uint16_t index = 0;
  std::uint16_t length = 0;
};

enum class UsbStatus {
  ok,
  not_ready,  ///< NAK: nothing yet, ask again
  stall,      ///< bulk and interrupt endpoints stay so until clear_halt
};

struct UsbAnswer {
  UsbStatus status = UsbStatus::ok;
  Bytes bytes;
};

/// Nanoseconds of whatever clock the test lives by; never decreases.
using Now = std::function<std::int64_t()>;

/// All calls come from one thread at a time. A device looks at its clock in every call and does by
/// itself whatever was due until then.
class UsbDevice {
 public:
  UsbDevice() = default;
  UsbDevice(const UsbDevice&) = delete;
  UsbDevice& operator=(const UsbDevice&) = delete;
  virtual ~UsbDevice() = default;

  /// As they travel: 18 bytes; the configuration with its interfaces and endpoints.
  virtual Bytes device_descriptor() const = 0;
  virtual Bytes configuration_descriptor() const = 0;
  /// String descriptor `index` (from 1), ASCII; empty: there is none.
  virtual std::string string(std::uint8_t index) const = 0;

  /// Class and vendor requests, and standard requests to an interface (a HID report descriptor).
  /// Standard requests to the device and to endpoints are answered by whoever attaches it.
  virtual UsbAnswer control(const UsbSetup& setup, std::span<const std::uint8_t> out) = 0;
  /// The data of one transfer to an endpoint (address without the direction bit).
  virtual UsbStatus out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) = 0;
  /// At most `room` bytes of one transfer: whole packets until one is short, `room` is full or
  /// nothing more is there now. With at least one byte or a packet of none: ok.
  virtual UsbAnswer in(std::uint8_t endpoint, std::size_t room) = 0;
  virtual void clear_halt(std::uint8_t endpoint_address) { static_cast<void>(endpoint_address); }
  /// The bus was reset, or it was plugged in: as after power-up.
  virtual void reset() = 0;
};

}  // namespace stickslip::emulated
