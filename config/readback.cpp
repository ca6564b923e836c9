// SPDX-License-Identifier: Apache-2.0
#include "config/readback.h"

#include <algorithm>
#include <cmath>

namespace stickslip::config {

namespace {

constexpr double packet_s = 0.005;  // unless samples_per_packet is set
constexpr double repeated_set_point_s = 0.05;
constexpr double relay_s = 0.05;
constexpr double gpio_thread_s = 0.3;
constexpr double fewest_periods = 16.0;
constexpr double default_overrun_s = 0.05;
constexpr double output_step_v = 5.0 / 4096.0;

double output_delay_s(const Bench& bench, double rate_hz) {
  double packet = packet_s;
  const std::optional<int> scans = bench.board == BoardKind::labjack_t7
                                       ? bench.labjack_t7.scans_per_packet
                                       : bench.labjack_u6.samples_per_packet;
  if (scans) packet = std::max(packet, *scans / rate_hz);
  const double overrun_s = bench.readback.longest_overrun_s;
  return (overrun_s > 0.0 ? overrun_s : default_overrun_s) + 2.0 * packet + repeated_set_point_s;
}

double at_least_some_periods(double delay_s, double rate_hz) {
  return std::max(delay_s, fewest_periods / rate_hz);
}

}  // namespace

ReadbackLimits drive_readback_limits(const Bench& bench, double rate_hz) {
  const DriveReadback& drive = *bench.readback.drive;
  const double span_v = (bench.shaker.high_v - bench.shaker.low_v) * std::abs(drive.gain);
  const double tolerance_v =
      0.01 * span_v + 2.0 * output_step_v * std::abs(drive.gain) + 0.001 * drive.input.range_v;
  const double delay_s = drive.delay_s.value_or(output_delay_s(bench, rate_hz));
  return {at_least_some_periods(delay_s, rate_hz), drive.tolerance_v.value_or(tolerance_v)};
}

ReadbackLimits enable_readback_limits(const Bench& bench, double rate_hz) {
  const bool on_chip = bench.amplifier && bench.amplifier->enable;
  const double delay_s = output_delay_s(bench, rate_hz) + relay_s + (on_chip ? gpio_thread_s : 0.0);
  return {at_least_some_periods(bench.readback.enable->delay_s.value_or(delay_s), rate_hz), 0.0};
}

}  // namespace stickslip::config
