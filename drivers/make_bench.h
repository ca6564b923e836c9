// From the configuration of a bench to its devices.
#pragma once

#include <memory>

#include "config/bench.h"
#include "drivers/bench/bench_driver.h"
#include "drivers/driver.h"

namespace stickslip::drivers {

/// The devices that the bench names, one by one, none of them open. `rate_hz`: scans of the board.
BenchParts make_bench_parts(const config::Bench& bench, double rate_hz);

/// The devices that the bench names as one rig, none of them open. `rate_hz`: scans of the board.
std::unique_ptr<Driver> make_bench(const config::Bench& bench, double rate_hz);

}  // namespace stickslip::drivers
