// The amplifier's contacts, as a bench uses them.
#pragma once

#include "drivers/driver.h"

namespace stickslip::drivers {

/// open, write and close in the loop's thread (or one after the other); signals in any.
class Contacts {
 public:
  Contacts() = default;
  Contacts(const Contacts&) = delete;
  Contacts& operator=(const Contacts&) = delete;
  virtual ~Contacts() = default;

  virtual Result open() = 0;
  /// Once a cycle, off as well as on.
  virtual Result write(bool amplifier_on) = 0;
  virtual Signals signals() const noexcept = 0;
  virtual void close() noexcept = 0;
};

}  // namespace stickslip::drivers
