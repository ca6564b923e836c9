// SPDX-License-Identifier: Apache-2.0
#include "drivers/usb/usb_location.h"

#include <array>
#include <cstddef>
#include <cstdint>

namespace stickslip::drivers {

std::string usb_location(libusb_device* device) {
  std::string place = "USB " + std::to_string(libusb_get_bus_number(device));
  std::array<std::uint8_t, 8> ports{};
  const int depth = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  for (int i = 0; i < depth; ++i) {
    place += i == 0 ? '-' : '.';
    place += std::to_string(ports[static_cast<std::size_t>(i)]);
  }
  return place;
}

}  // namespace stickslip::drivers
