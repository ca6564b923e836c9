// Every device of a bench tried by itself, for `stickslip check --live`: does it speak, and what
// does it say? Nothing is driven: no output leaves its rest, and the amplifier is never enabled.
#pragma once

#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/bench/bench_driver.h"
#include "physics/frame.h"

namespace stickslip::drivers {

/// What an input said, on average over the time for which it was listened to.
struct FirstReading {
  std::string input;
  Channel channel = Channel::displacement;
  double mean = 0.0;    ///< in the device's unit
  double spread = 0.0;  ///< standard deviation
  std::string unit;
  std::size_t readings = 0;  ///< that it believes itself; 0: none came
};

struct TriedDevice {
  std::string name;
  bool well = false;
  std::string words;  ///< what is wrong, or what else is to be said; may be empty
  std::vector<FirstReading> readings;
};

/// Tries one after the other, in the order amplifier, board, gauges. Each is closed again. Takes
/// up to `patience_s` for each.
std::vector<TriedDevice> try_bench(BenchParts parts, const config::Bench& bench, double patience_s);

}  // namespace stickslip::drivers
