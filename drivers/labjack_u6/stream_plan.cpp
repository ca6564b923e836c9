// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_u6/stream_plan.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "drivers/labjack_u6/stream_decoder.h"
#include "physics/number_text.h"

namespace stickslip::drivers::labjack_u6 {

namespace {

constexpr double rate_tolerance = 50e-6;
// The part of the total latency of 5 to 10 ms that a sample may wait for its transfer to fill.
constexpr double transfer_s = 0.005;
constexpr int max_packets_per_transfer = 32;

std::string line_error(const char* key, const std::optional<int>& line) {
  if (!line || (*line >= 0 && *line < digital_lines)) return {};
  return std::string(key) + " = " + std::to_string(*line) +
         ": the board has lines 0 to 19 (FIO0-7, EIO0-7, CIO0-3)";
}

std::string rate_error(double rate_hz, std::size_t channels) {
  const std::string rate = "loop.rate_hz = " + physics::number_text(rate_hz, 9);
  if (!(rate_hz > 0.0) || !std::isfinite(rate_hz)) return rate + ": must be positive";
  const double samples_hz = rate_hz * static_cast<double>(channels);
  if (samples_hz > highest_sample_rate_hz) {
    return rate + " with " + physics::counted(channels, "input") +
           ": the board takes 50000 samples/s over all inputs, so at most " +
           physics::number_text(highest_sample_rate_hz / static_cast<double>(channels), 9) + " Hz";
  }
  const ScanClock clock = nearest_clock(rate_hz);
  if (deviation(clock, rate_hz) > rate_tolerance) {
    return rate +
           ": the board's clocks cannot produce it within 50 parts in a million. The nearest is " +
           physics::number_text(clock.rate_hz(), 9);
  }
  return {};
}

/// The enable line must suit the watchdog and be no input.
std::string enable_line_error(const config::LabjackU6& settings) {
  if (!settings.enable_line) return {};
  const std::string line = "labjack_u6.enable_line = " + std::to_string(*settings.enable_line);
  if (settings.has_watchdog() && *settings.enable_line >= watchdog_lines) {
    return line +
           ": the board's watchdog reaches lines 0 to 15 only. Use one of those, or set "
           "watchdog_s = 0";
  }
  if (settings.enable_line == settings.amplifier_fault_line ||
      settings.enable_line == settings.emergency_stop_line) {
    return line + " is also used as an input. It needs a separate line";
  }
  return {};
}

/// As configured, else as many as arrive within transfer_s: with few inputs or a slow clock, a full
/// packet would arrive too late for a drive that follows the frames.
int samples_per_packet(const config::LabjackU6& settings, std::size_t inputs, double rate_hz) {
  if (settings.samples_per_packet) return *settings.samples_per_packet;
  const double in_time = transfer_s * rate_hz * static_cast<double>(inputs);
  return static_cast<int>(std::clamp(in_time, 1.0, double{max_samples_per_packet}));
}

}  // namespace

std::string settings_error(const config::LabjackU6& settings, const config::BenchInputs& inputs,
                           double rate_hz) {
  std::size_t channels = 0;
  std::string wrong_input = labjack::inputs_error("labjack_u6", inputs, settings, channels);
  if (!wrong_input.empty()) return wrong_input;
  for (const std::string& error :
       {rate_error(rate_hz, channels),
        labjack::range_error("labjack_u6.resolution_index", settings.resolution_index, 0, 8),
        labjack::range_error("labjack_u6.settling", settings.settling, 0, 255),
        labjack::range_error("labjack_u6.samples_per_packet",
                             settings.samples_per_packet.value_or(1), 1, 25),
        labjack::range_error("labjack_u6.transfers", settings.transfers, 1, 64),
        labjack::range_error("labjack_u6.dac", settings.dac, 0, 1),
        labjack::range_error("labjack_u6.watchdog_s", settings.watchdog_s, 0, 65535),
        line_error("labjack_u6.enable_line", settings.enable_line),
        line_error("labjack_u6.amplifier_fault_line", settings.amplifier_fault_line),
        line_error("labjack_u6.emergency_stop_line", settings.emergency_stop_line),
        enable_line_error(settings)}) {
    if (!error.empty()) return error;
  }
  return {};
}

StreamPlan stream_plan(const config::LabjackU6& settings, const config::BenchInputs& inputs,
                       double rate_hz) {
  StreamPlan plan;
  static_cast<labjack::ScanLayout&>(plan) = labjack::layout_of(inputs, settings);
  plan.clock = nearest_clock(rate_hz);
  plan.samples_per_packet = samples_per_packet(settings, plan.scan.size(), rate_hz);
  plan.transfers = settings.transfers;
  // A packet that is not full ends its transfer.
  if (plan.samples_per_packet == max_samples_per_packet) {
    const double packets_hz =
        rate_hz * static_cast<double>(plan.scan.size()) / max_samples_per_packet;
    plan.packets_per_transfer =
        std::clamp(static_cast<int>(packets_hz * transfer_s), 1, max_packets_per_transfer);
  }
  return plan;
}

}  // namespace stickslip::drivers::labjack_u6
