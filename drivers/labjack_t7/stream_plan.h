// SPDX-License-Identifier: Apache-2.0
// Settings of a LabJack T7 checked and turned into a stream and a watchdog.
#pragma once

#include <cstdint>
#include <string>

#include "config/bench.h"
#include "drivers/labjack/scan_layout.h"
#include "drivers/labjack_t7/protocol.h"

namespace stickslip::drivers::labjack_t7 {

/// Stream configuration.
struct StreamPlan : labjack::ScanLayout {
  labjack::ConverterCalibration calibration;
  double rate_hz = 0.0;
  std::int64_t interval_ns = 0;  ///< of the scans, exact
  int scans_per_packet = 1;
  std::uint32_t buffer_bytes = 0;  ///< of the board, a power of two

  int samples_per_packet() const { return scans_per_packet * static_cast<int>(scan.size()); }
};

/// The first setting that the board cannot satisfy, with the permitted values; empty if all are
/// valid. `inputs` are those on this board, `rate_hz` is the scan rate.
std::string settings_error(const config::LabjackT7& settings, const config::BenchInputs& inputs,
                           double rate_hz);

/// For settings without a settings_error. The calibration is left at its default.
StreamPlan stream_plan(const config::LabjackT7& settings, const config::BenchInputs& inputs,
                       double rate_hz);

/// Range and reference of every input.
void configure_inputs(Feedback& request, const StreamPlan& plan);
/// The stream itself, to a connection to the board's stream port.
void configure_stream(Feedback& request, const StreamPlan& plan, const config::LabjackT7& settings);

/// After watchdog_s without its key: enable line low, DAC at rest, all else untouched. The board
/// takes these settings only while its watchdog is disabled.
void arm_watchdog(Feedback& request, const config::LabjackT7& settings, double rest_v);

/// Difference of a rate from the one of that interval.
double deviation(std::int64_t interval_ns, double rate_hz);
inline constexpr double rate_tolerance = 50e-6;

}  // namespace stickslip::drivers::labjack_t7
