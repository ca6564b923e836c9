// The seam between the loop and the observer: what the loop carries in every sample, and what it
// calls to get it.
#pragma once

#include "drivers/driver.h"
#include "physics/frame.h"

namespace stickslip::daemon {

struct Estimate {
  bool present = false;
};

class Observer {
 public:
  Estimate update(const Frame& frame, const drivers::Actuation& actuation);
};

inline Estimate Observer::update(const Frame& /*frame*/, const drivers::Actuation& /*actuation*/) {
  return {};
}

}  // namespace stickslip::daemon
