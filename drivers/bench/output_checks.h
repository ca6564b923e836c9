// SPDX-License-Identifier: Apache-2.0
// The outputs of a bench against what spare inputs read back of them.
#pragma once

#include <cstdint>
#include <optional>

#include "config/bench.h"
#include "drivers/bench/readback_check.h"
#include "drivers/driver.h"

namespace stickslip::drivers {

/// Checks the outputs that have an input in [readback]; none by default. Does not allocate.
class OutputChecks {
 public:
  OutputChecks() = default;
  /// `rate_hz`: of the loop.
  OutputChecks(const config::Bench& bench, double rate_hz);

  bool any() const { return drive_.has_value() || enable_.has_value(); }
  /// Forgets everything, as at the start of a stream.
  void restart();
  /// The command to the outputs, at a time on the host's clock.
  void command(double drive_v, bool amplifier_on, std::int64_t time_ns);
  /// Their readings at a time on the host's clock.
  void read(const OutputReadings& readings, std::int64_t time_ns);

  DifferingOutput differing() const;

 private:
  config::Readback settings_;
  std::optional<ReadbackCheck> drive_;
  std::optional<ReadbackCheck> enable_;  // 1: on, 0: off
};

}  // namespace stickslip::drivers
