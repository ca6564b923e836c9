// SPDX-License-Identifier: Apache-2.0
#include "config/readback.h"

#include <algorithm>
#include <cmath>

namespace stickslip::config {

namespace {

constexpr double labjack_packet_s = 0.005;  // unless samples_per_packet is set
constexpr double repeated_set_point_s = 0.05;
constexpr double usb_1208fs_immediate_hz = 100.0;  // up to which each scan has its own packet
constexpr double usb_1208fs_packet_s = 0.01;
constexpr double usb_1208fs_packet_samples = 32.0;
constexpr double usb_1208fs_dry_s = 0.2;  // until an output that ran dry is noticed
constexpr double relay_s = 0.05;
constexpr double gpio_thread_s = 0.3;
constexpr double fewest_periods = 16.0;
constexpr double default_overrun_s = 0.05;
constexpr double output_step_v = 5.0 / 4096.0;

/// Longest time from one packet of readings to the next.
double packet_s(const Bench& bench, double rate_hz) {
  if (bench.board == BoardKind::usb_1208fs_plus) {
    if (rate_hz <= usb_1208fs_immediate_hz) return 1.0 / rate_hz;
    const BenchInputs own = inputs_of(bench.inputs, std::string(name_of(bench.board)));
    const bool pairs = std::any_of(own.begin(), own.end(),
                                   [](const auto& input) { return input && input->differential; });
    const double most_inputs = pairs ? 4.0 : 8.0;  // spare ones fill packets
    return std::max(usb_1208fs_packet_s, usb_1208fs_packet_samples / (most_inputs * rate_hz));
  }
  const std::optional<int> scans = bench.board == BoardKind::labjack_t7
                                       ? bench.labjack_t7.scans_per_packet
                                       : bench.labjack_u6.samples_per_packet;
  return std::max(labjack_packet_s, scans ? *scans / rate_hz : 0.0);
}

/// From the loop to the board, and from the board back to the loop.
double loop_delay_s(const Bench& bench, double rate_hz) {
  const double overrun_s = bench.readback.longest_overrun_s;
  return (overrun_s > 0.0 ? overrun_s : default_overrun_s) + 2.0 * packet_s(bench, rate_hz);
}

double output_delay_s(const Bench& bench, double rate_hz) {
  const double of_board = bench.board == BoardKind::usb_1208fs_plus
                              ? bench.usb_1208fs_plus.output_ahead_s + usb_1208fs_dry_s
                              : repeated_set_point_s;
  return loop_delay_s(bench, rate_hz) + of_board;
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
  const bool in_board = bench.board != BoardKind::usb_1208fs_plus;
  const double delay_s = loop_delay_s(bench, rate_hz) + (in_board ? repeated_set_point_s : 0.0) +
                         relay_s + (on_chip ? gpio_thread_s : 0.0);
  return {at_least_some_periods(bench.readback.enable->delay_s.value_or(delay_s), rate_hz), 0.0};
}

}  // namespace stickslip::config
