// SPDX-License-Identifier: Apache-2.0
// A device found on this host, for `stickslip devices`.
#pragma once

#include <string>

namespace stickslip::drivers {

/// A device that was found, usable or not.
struct AttachedDevice {
  std::string kind;      ///< as in a configuration: "labjack_u6"
  std::string name;      ///< for display: "LabJack U6-Pro #360009876, firmware 1.43"
  std::string serial;    ///< as a configuration takes it; empty: it could not be read
  std::string location;  ///< "USB 1-2.3", "/dev/hidraw0"
  std::string problem;   ///< why it cannot be used, and the remedy; empty: it responds
};

}  // namespace stickslip::drivers
