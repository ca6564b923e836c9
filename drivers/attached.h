// What is found on a host's buses, for `stickslip devices`.
#pragma once

#include <string>
#include <vector>

namespace stickslip::drivers {

/// One device that was found, whether or not it can be used.
struct Attached {
  std::string kind;     ///< as a configuration names it: "labjack_u6"
  std::string name;     ///< for a person: "LabJack U6-Pro #360009876, firmware 1.43"
  std::string serial;   ///< as a configuration takes it; empty: it could not be read
  std::string where;    ///< "USB 1-2.3", "/dev/hidraw0"
  std::string trouble;  ///< what keeps it from being used and what to do; empty: it speaks
};

}  // namespace stickslip::drivers
