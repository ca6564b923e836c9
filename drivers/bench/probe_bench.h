// SPDX-License-Identifier: Apache-2.0
// Probe of every device of a bench, for `stickslip check --live`: does it respond, and with which
// readings? Nothing is driven: outputs stay at rest, and the amplifier is never enabled.
#pragma once

#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/bench/bench_driver.h"
#include "physics/frame.h"

namespace stickslip::drivers {

/// Mean reading of an input over the time of the probe.
struct ProbedInput {
  std::string input;
  Channel channel = Channel::displacement;
  double mean = 0.0;  ///< in the unit of the device
  double standard_deviation = 0.0;
  std::string unit;
  std::size_t readings = 0;  ///< valid readings; 0: none arrived
};

struct ProbedDevice {
  std::string name;
  bool ok = false;
  std::string message;  ///< a failure or a remark; may be empty
  std::vector<ProbedInput> readings;
};

/// Probes one after the other, in the order amplifier, board, gauges, and closes each again. Takes
/// up to `duration_s` for each.
std::vector<ProbedDevice> probe_bench(BenchParts parts, const config::Bench& bench,
                                      double duration_s);

}  // namespace stickslip::drivers
