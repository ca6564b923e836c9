// SPDX-License-Identifier: Apache-2.0
// Construction of the devices of a bench from its configuration.
#pragma once

#include <memory>

#include "config/bench.h"
#include "drivers/bench/bench_driver.h"
#include "drivers/driver.h"

namespace stickslip::drivers {

/// The configured devices, not open. `rate_hz`: scan rate of the board.
BenchParts make_bench_parts(const config::Bench& bench, double rate_hz);

/// The configured devices as one driver, not open. `rate_hz`: scan rate of the board.
std::unique_ptr<Driver> make_bench(const config::Bench& bench, double rate_hz);

}  // namespace stickslip::drivers
