// SPDX-License-Identifier: Apache-2.0
// Settings of a LabJack U6 checked and turned into a stream: the scan list, its clock, and the size
// of packets and transfers.
#pragma once

#include <string>

#include "config/bench.h"
#include "drivers/labjack/scan_layout.h"
#include "drivers/labjack_u6/protocol.h"

namespace stickslip::drivers::labjack_u6 {

/// Stream configuration.
struct StreamPlan : labjack::ScanLayout {
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

}  // namespace stickslip::drivers::labjack_u6
