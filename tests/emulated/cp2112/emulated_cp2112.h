// SPDX-License-Identifier: Apache-2.0
// An emulated CP2112 adapter (USB HID to eight GPIO lines), a GPIO chip by the kernel's driver, for
// the amplifier's contacts on hosts without a header. Written from the adapter's feature reports;
// without I2C.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>

#include "tests/emulated/usb_device.h"
#include "tests/emulated/wires.h"

namespace stickslip::emulated {

/// Assignment of the lines 0 to 7; absent: not connected.
struct Cp2112Lines {
  std::optional<int> enable;          ///< high: enabled; pulled down by the contact
  std::optional<int> fault;           ///< low: fault
  std::optional<int> emergency_stop;  ///< low: pressed
  std::optional<int> heartbeat;
};

/// Any thread may call it.
class EmulatedCp2112 final : public UsbDevice {
 public:
  EmulatedCp2112(Wires& wires, Now now, const Cp2112Lines& lines)
      : wires_(wires), now_(std::move(now)), lines_(lines) {}

  Bytes device_descriptor() const override;
  Bytes configuration_descriptor() const override;
  std::string string(std::uint8_t index) const override;
  UsbAnswer control(const UsbSetup& setup, std::span<const std::uint8_t> out) override;
  UsbStatus out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) override;
  UsbAnswer in(std::uint8_t endpoint, std::size_t capacity) override;
  void reset() override;

  /// Number of edges of the heartbeat line.
  std::uint64_t heartbeats() const;

 private:
  UsbAnswer get_report(std::uint8_t id) const;
  UsbAnswer set_report(std::span<const std::uint8_t> report);
  std::uint8_t levels() const;
  void settle();

  Wires& wires_;
  Now now_;
  Cp2112Lines lines_;
  mutable std::mutex mutex_;
  std::uint8_t outputs_ = 0;    // bit i: line i drives
  std::uint8_t push_pull_ = 0;  // else open drain
  std::uint8_t special_ = 0;
  std::uint8_t clock_divider_ = 0;
  std::uint8_t latch_ = 0xFF;
  Bytes smbus_;
  bool heartbeat_ = false;
  std::uint64_t heartbeats_ = 0;
};

}  // namespace stickslip::emulated
