// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_t7/stream_plan.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "physics/number_text.h"

namespace stickslip::drivers::labjack_t7 {

namespace {

// The part of the total latency of 5 to 10 ms that a sample may wait for its packet to fill.
constexpr double packet_s = 0.005;
// The board's buffer outlasts a host that is late by this much.
constexpr double buffer_s = 1.0;
constexpr std::uint32_t smallest_buffer_bytes = 4096;  // the board's default
constexpr std::uint32_t largest_buffer_bytes = 32768;

std::string line_error(const std::string& key, const std::optional<int>& line) {
  if (!line || (*line >= 0 && *line < digital_lines)) return {};
  return key + " = " + std::to_string(*line) +
         ": the board has lines 0 to 22 (FIO0-7, EIO0-7, CIO0-3, MIO0-2)";
}

std::string rate_error(double rate_hz, std::size_t channels) {
  const std::string rate = "loop.rate_hz = " + physics::number_text(rate_hz, 9);
  if (!(rate_hz > 0.0) || !std::isfinite(rate_hz)) return rate + ": must be positive";
  const double most = highest_sample_rate_hz / static_cast<double>(channels);
  if (rate_hz > most) {
    return rate + " with " + physics::counted(channels, "input") +
           ": the board takes 100000 samples/s over all inputs, so at most " +
           physics::number_text(most, 9) + " Hz";
  }
  const std::int64_t interval = interval_ns(rate_hz);
  if (interval == 0 || deviation(interval, rate_hz) > rate_tolerance) {
    const double nearest = interval == 0 ? 0.0 : 1e9 / static_cast<double>(interval);
    return rate +
           ": the board's clock cannot produce it within 50 parts in a million. The nearest "
           "is " +
           physics::number_text(nearest, 9);
  }
  return {};
}

std::string enable_line_error(const config::LabjackT7& settings) {
  if (!settings.enable_line) return {};
  if (settings.enable_line == settings.amplifier_fault_line ||
      settings.enable_line == settings.emergency_stop_line) {
    return "labjack_t7.enable_line = " + std::to_string(*settings.enable_line) +
           " is also used as an input. It needs a separate line";
  }
  return {};
}

int scans_per_packet(const config::LabjackT7& settings, std::size_t inputs, double rate_hz) {
  const int most = largest_samples_per_packet / static_cast<int>(inputs);
  const int in_time = static_cast<int>(std::min(packet_s * rate_hz, 1000.0));
  return std::clamp(settings.scans_per_packet.value_or(in_time), 1, most);
}

std::uint32_t buffer_bytes(std::size_t inputs, double rate_hz) {
  const double wanted = 2.0 * static_cast<double>(inputs) * rate_hz * buffer_s;
  std::uint32_t bytes = smallest_buffer_bytes;
  while (bytes < largest_buffer_bytes && bytes < wanted) bytes *= 2;
  return bytes;
}

}  // namespace

double deviation(std::int64_t interval_ns, double rate_hz) {
  return std::abs(1e9 / (static_cast<double>(interval_ns) * rate_hz) - 1.0);
}

std::string settings_error(const config::LabjackT7& settings, const config::BenchInputs& inputs,
                           double rate_hz) {
  if (settings.host.empty()) {
    return "labjack_t7.host is empty: expected the board's name or address, such as 192.168.1.207";
  }
  std::size_t channels = 0;
  std::string wrong_input = labjack::inputs_error("labjack_t7", inputs, settings, channels);
  if (!wrong_input.empty()) return wrong_input;
  const int most_scans = largest_samples_per_packet / static_cast<int>(channels);
  for (const std::string& error :
       {rate_error(rate_hz, channels),
        labjack::range_error("labjack_t7.port", settings.port, 1, 65535),
        labjack::range_error("labjack_t7.stream_port", settings.stream_port, 1, 65535),
        labjack::range_error("labjack_t7.resolution_index", settings.resolution_index, 0, 8),
        labjack::range_error("labjack_t7.scans_per_packet", settings.scans_per_packet.value_or(1),
                             1, most_scans),
        labjack::range_error("labjack_t7.dac", settings.dac, 0, 1),
        labjack::range_error("labjack_t7.watchdog_s", settings.watchdog_s, 0, 65535),
        line_error("labjack_t7.enable_line", settings.enable_line),
        line_error("labjack_t7.amplifier_fault_line", settings.amplifier_fault_line),
        line_error("labjack_t7.emergency_stop_line", settings.emergency_stop_line),
        enable_line_error(settings)}) {
    if (!error.empty()) return error;
  }
  if (!(settings.settling_us >= 0.0 && settings.settling_us <= 4400.0)) {
    return "labjack_t7.settling_us = " + physics::number_text(settings.settling_us, 9) +
           ": must be 0 to 4400";
  }
  return {};
}

StreamPlan stream_plan(const config::LabjackT7& settings, const config::BenchInputs& inputs,
                       double rate_hz) {
  StreamPlan plan;
  static_cast<labjack::ScanLayout&>(plan) = labjack::layout_of(inputs, settings);
  plan.rate_hz = rate_hz;
  plan.interval_ns = interval_ns(rate_hz);
  plan.scans_per_packet = scans_per_packet(settings, plan.scan.size(), rate_hz);
  plan.buffer_bytes = buffer_bytes(plan.scan.size(), rate_hz);
  return plan;
}

void configure_inputs(Feedback& request, const StreamPlan& plan) {
  constexpr float ranges_v[labjack::gain_count] = {10.0F, 1.0F, 0.1F, 0.01F};
  for (const labjack::StreamChannel& channel : plan.scan) {
    const auto negative = static_cast<std::uint16_t>(channel.input + 1);
    request.write_float(ain0_range + 2 * channel.input, ranges_v[channel.gain])
        .write_word(ain0_negative + channel.input, channel.differential ? negative : single_ended);
  }
}

void configure_stream(Feedback& request, const StreamPlan& plan,
                      const config::LabjackT7& settings) {
  request.write_float(stream_scan_rate, static_cast<float>(plan.rate_hz))
      .write(stream_inputs, static_cast<std::uint32_t>(plan.scan.size()))
      .write(stream_samples_per_packet, static_cast<std::uint32_t>(plan.samples_per_packet()))
      .write_float(stream_settling_us, static_cast<float>(settings.settling_us))
      .write(stream_resolution_index, static_cast<std::uint32_t>(settings.resolution_index))
      .write(stream_buffer_bytes, plan.buffer_bytes)
      .write(stream_clock_source, 0)
      .write(stream_target, ethernet_target)
      .write(stream_data_type, 0)
      .write(stream_scans, 0)
      .write(stream_trigger, 0);
  int entry = 0;
  for (const labjack::StreamChannel& channel : plan.scan) {
    request.write(stream_list0 + 2 * entry++, static_cast<std::uint32_t>(ain0 + 2 * channel.input));
  }
}

void arm_watchdog(Feedback& request, const config::LabjackT7& settings, double rest_v) {
  const std::uint32_t line = 1U << static_cast<unsigned>(settings.enable_line.value_or(0));
  const auto timeout_s = static_cast<std::uint32_t>(settings.watchdog_s);
  const bool first_dac = settings.dac == 0;
  request.write(watchdog_enable, 0)
      .write(watchdog_advanced, 0)
      .write(watchdog_timeout_s, timeout_s)
      .write(watchdog_startup_delay_s, timeout_s)
      .write(watchdog_strict, 1)
      .write(watchdog_strict_key, watchdog_key)
      .write(watchdog_reset, 0)
      .write(watchdog_dio, 1)
      .write(watchdog_dio_state, 0)
      .write(watchdog_dio_direction, line)
      .write(watchdog_dio_inhibit, ~line)
      .write(watchdog_dac0, first_dac ? 1 : 0)
      .write(watchdog_dac1, first_dac ? 0 : 1)
      .write_float(first_dac ? watchdog_dac0_v : watchdog_dac1_v, static_cast<float>(rest_v))
      .write(watchdog_enable, 1)
      .write(watchdog_strict_clear, watchdog_key);
}

}  // namespace stickslip::drivers::labjack_t7
