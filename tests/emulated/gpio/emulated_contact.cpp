// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/gpio/emulated_contact.h"

#include <utility>

#include "tests/emulated/gpio/emulated_gpio.h"

namespace stickslip::emulated {

EmulatedContact::EmulatedContact(Wiring wiring, Now now)
    : wiring_(std::move(wiring)), now_(std::move(now)) {}

bool EmulatedContact::closed() {
  const std::lock_guard hold(mutex_);
  const bool relay = relay_closed();
  if (!welded_) closed_ = relay && emulated_gpio().level(wiring_.chip, wiring_.enable);
  return closed_;
}

bool EmulatedContact::relay_closed() {
  if (!wiring_.heartbeat || relay_held_) return true;
  const std::size_t edges = emulated_gpio().history(wiring_.chip, *wiring_.heartbeat).size();
  // The first level of the line is no edge, nor is that after a chip was plugged in again.
  if (edges > edges_ && edges > 1) last_edge_ns_ = now_();
  edges_ = edges;
  return last_edge_ns_ && now_() - *last_edge_ns_ < wiring_.hold_ns;
}

void EmulatedContact::set_welded(bool welded) {
  const std::lock_guard hold(mutex_);
  welded_ = welded;
}

void EmulatedContact::cut() {
  const std::lock_guard hold(mutex_);
  welded_ = true;
  closed_ = false;
}

void EmulatedContact::set_relay_held(bool held) {
  const std::lock_guard hold(mutex_);
  relay_held_ = held;
}

}  // namespace stickslip::emulated
