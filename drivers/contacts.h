// SPDX-License-Identifier: Apache-2.0
// Interface of the amplifier's contacts.
#pragma once

#include "drivers/driver.h"

namespace stickslip::drivers {

/// open, write, switch_off and close in the loop's thread (or one after the other); signals in any.
class Contacts {
 public:
  Contacts() = default;
  Contacts(const Contacts&) = delete;
  Contacts& operator=(const Contacts&) = delete;
  virtual ~Contacts() = default;

  virtual Result open() = 0;
  /// Once a cycle, off as well as on. Does not wait for the contacts: one of the next calls reports
  /// their failure.
  virtual Result write(bool amplifier_on) = 0;
  /// Switches off; ok only if confirmed. For shutdown: may wait.
  virtual Result switch_off() = 0;
  virtual Signals signals() const noexcept = 0;
  virtual void close() noexcept = 0;
};

}  // namespace stickslip::drivers
