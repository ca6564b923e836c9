// SPDX-License-Identifier: Apache-2.0
// Settings of a LabJack U6 checked and turned into a stream: the scan list, its clock, and the size
// of packets and transfers.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/labjack_u6/protocol.h"
#include "physics/frame.h"

namespace stickslip::drivers::labjack_u6 {

/// Stream configuration. Entries of `scan` and `channel` correspond; further entries of `scan` read
/// the outputs back.
struct StreamPlan {
  std::vector<StreamChannel> scan;             ///< in sampling order
  std::vector<Channel> channel;                ///< the measured quantity
  std::optional<std::size_t> drive_readback;   ///< position in the scan
  std::optional<std::size_t> enable_readback;  ///< position in the scan
  ScanClock clock;
  Calibration calibration;
  int samples_per_packet = 25;
  int transfers = 8;
  int packets_per_transfer = 1;
};

/// The first setting that the board cannot satisfy, with the permitted values; empty if all are
/// valid. `inputs` are those on this board, `rate_hz` is the scan rate.
std::string settings_error(const config::LabjackU6& settings, const config::BenchInputs& inputs,
                           double rate_hz);

/// For settings without a settings_error. The calibration is left at its default.
StreamPlan stream_plan(const config::LabjackU6& settings, const config::BenchInputs& inputs,
                       double rate_hz);

/// True if the board's watchdog guards the enable line.
bool has_watchdog(const config::LabjackU6& settings);

}  // namespace stickslip::drivers::labjack_u6
