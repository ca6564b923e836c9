// SPDX-License-Identifier: Apache-2.0
// The amplifier's enable contact behind an emulated GPIO chip, in series with a watchdog relay.
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "tests/emulated/usb_device.h"

namespace stickslip::emulated {

/// Closed while the enable line is high and the relay, if there is one, sees edges of the
/// heartbeat. Any thread.
class EmulatedContact {
 public:
  struct Wiring {
    std::string chip;  ///< path
    unsigned enable = 0;
    std::optional<unsigned> heartbeat;     ///< of the watchdog relay; none: there is no relay
    std::int64_t hold_ns = 1'000'000'000;  ///< the relay drops out after this time without edges
  };
  EmulatedContact(Wiring wiring, Now now);

  bool closed();
  /// It keeps its state, whatever its lines do; afterwards it follows them.
  void set_welded(bool welded);
  /// It opens and stays open, as by a broken wire.
  void cut();
  /// The relay is held: it needs no heartbeat.
  void set_relay_held(bool held);

 private:
  bool relay_closed();

  Wiring wiring_;
  Now now_;
  std::mutex mutex_;
  std::size_t edges_ = 0;
  std::optional<std::int64_t> last_edge_ns_;
  bool closed_ = false;
  bool welded_ = false;
  bool relay_held_ = false;
};

}  // namespace stickslip::emulated
