// SPDX-License-Identifier: Apache-2.0
// Interface of an emulated USB device. It is attached either by an in-process replacement of the
// driver's library, or to the kernel's USB stack through vhci-hcd; the emulation is independent of
// that.
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
  not_ready,  ///< NAK: nothing yet, retry
  stall,      ///< bulk and interrupt endpoints stay stalled until clear_halt
};

struct UsbAnswer {
  UsbStatus status = UsbStatus::ok;
  Bytes bytes;
};

/// Time on the clock of the test [ns]; never decreases.
using Now = std::function<std::int64_t()>;

/// All calls come from one thread at a time. In every call a device reads its clock and performs
/// the actions due by then.
class UsbDevice {
 public:
  UsbDevice() = default;
  UsbDevice(const UsbDevice&) = delete;
  UsbDevice& operator=(const UsbDevice&) = delete;
  virtual ~UsbDevice() = default;

  /// Raw descriptors: 18 bytes; the configuration with its interfaces and endpoints.
  virtual Bytes device_descriptor() const = 0;
  virtual Bytes configuration_descriptor() const = 0;
  /// String descriptor `index` (from 1), ASCII; empty: none.
  virtual std::string string(std::uint8_t index) const = 0;

  /// Class and vendor requests, and standard requests to an interface (a HID report descriptor).
  /// Standard requests to the device and to endpoints are handled by the attachment.
  virtual UsbAnswer control(const UsbSetup& setup, std::span<const std::uint8_t> out) = 0;
  /// The data of one transfer to an endpoint (address without the direction bit).
  virtual UsbStatus out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) = 0;
  /// At most `capacity` bytes of one transfer: complete packets until one is short, the capacity is
  /// reached or no more data are available. ok with at least one byte or an empty packet.
  virtual UsbAnswer in(std::uint8_t endpoint, std::size_t capacity) = 0;
  virtual void clear_halt(std::uint8_t endpoint_address) { static_cast<void>(endpoint_address); }
  /// After a bus reset or plugging in: the state after power-up.
  virtual void reset() = 0;
};

}  // namespace stickslip::emulated
