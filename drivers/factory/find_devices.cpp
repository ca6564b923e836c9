// SPDX-License-Identifier: Apache-2.0
#include "drivers/factory/find_devices.h"

#include <iterator>
#include <utility>

#include "drivers/amplifier/amplifier.h"
#include "drivers/labjack_u6/labjack_u6_driver.h"
#include "drivers/phidget_bridge/phidget_bridge.h"
#include "drivers/usb_1208fs_plus/usb_1208fs_plus_driver.h"

namespace stickslip::drivers {

std::vector<AttachedDevice> find_devices() {
  std::vector<AttachedDevice> all;
  for (auto find : {find_labjack_u6, find_usb_1208fs_plus, find_phidget_bridge, find_gpio_chips}) {
    std::vector<AttachedDevice> found = find();
    std::move(found.begin(), found.end(), std::back_inserter(all));
  }
  return all;
}

}  // namespace stickslip::drivers
