// SPDX-License-Identifier: Apache-2.0
#include "drivers/usb_1208fs_plus/protocol.h"
#include "physics/number_text.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>

namespace stickslip::drivers::usb_1208fs_plus {

namespace {

/// Over all inputs; limit of the converter.
constexpr double max_sample_rate_hz = 51200.0;
constexpr double max_immediate_rate_hz = 100.0;
constexpr double max_packet_s = 0.01;
constexpr double samples_per_packet = packet_bytes / 2.0;

std::uint32_t word_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  std::uint32_t word = 0;
  for (std::size_t i = 4; i-- > 0;) word = (word << 8U) | bytes[at + i];
  return word;
}

template <std::size_t size>
void put_word(std::array<std::uint8_t, size>& bytes, std::size_t at, std::uint32_t word) {
  for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::uint8_t>(word >> (8U * i));
}

Correction correction_at(std::span<const std::uint8_t> memory, std::size_t at) {
  return {std::bit_cast<float>(word_at(memory, at)), std::bit_cast<float>(word_at(memory, at + 4))};
}

bool plausible(const Correction& correction) {
  return std::isfinite(correction.slope) && std::isfinite(correction.offset) &&
         std::abs(correction.slope - 1.0F) < 0.25F && std::abs(correction.offset) < 512.0F;
}

/// "CH3": 3. None if there is no such input.
std::optional<std::uint8_t> channel_number(const std::string& name) {
  if (name.size() != 3 || !name.starts_with("CH") || name[2] < '0' || name[2] > '7') {
    return std::nullopt;
  }
  return static_cast<std::uint8_t>(name[2] - '0');
}

std::optional<std::uint8_t> range_code(double range_v, bool differential) {
  if (!differential) return range_v == 10.0 ? std::optional<std::uint8_t>(0) : std::nullopt;
  for (std::uint8_t code = 0; code < differential_ranges_v.size(); ++code) {
    if (std::abs(differential_ranges_v[code] - range_v) < 1e-9) return code;
  }
  return std::nullopt;
}

std::string range_error(const std::string& where, double range_v, bool differential) {
  return where + " has a range of " + physics::shortest_text(range_v) + " V; a " +
         (differential
              ? "differential input of this board has 20, 10, 5, 4, 2.5, 2, 1.25 or 1 V"
              : "single-ended input of this board has 10 V only, a differential one others "
                "(set differential = true)");
}

/// `use`: what the input is for, as in the configuration.
std::optional<ScanChannel> scan_channel(const config::BenchInput& input, std::string_view use,
                                        std::string& refusal) {
  const std::string where =
      "USB-1208FS-Plus: the input " + input.input + " for " + std::string(use);
  const auto number = channel_number(input.input);
  const int inputs = input.differential ? 4 : 8;
  if (!number || *number >= inputs) {
    refusal = where + " does not exist; " +
              (input.differential ? "differential inputs are CH0 to CH3" : "inputs are CH0 to CH7");
    return std::nullopt;
  }
  const auto code = range_code(input.range_v, input.differential);
  if (!code) {
    refusal = range_error(where, input.range_v, input.differential);
    return std::nullopt;
  }
  return ScanChannel{*number, *code, input.range_v, std::nullopt};
}

void fill_packets(ScanPlan& plan, double rate_hz) {
  const std::size_t inputs = plan.differential ? 4 : 8;
  const auto too_slow = [&] {
    return static_cast<double>(plan.channels.size()) * rate_hz * max_packet_s < samples_per_packet;
  };
  const ScanChannel pattern = plan.channels.front();
  for (std::uint8_t channel = 0; channel < inputs && too_slow(); ++channel) {
    const bool taken = std::any_of(plan.channels.begin(), plan.channels.end(),
                                   [&](const auto& one) { return one.channel == channel; });
    if (!taken)
      plan.channels.push_back({channel, pattern.range_code, pattern.range_v, std::nullopt});
  }
}

/// Adds an input to the plan; null: it is refused.
ScanChannel* add_input(ScanPlan& plan, const config::BenchInput& input, std::string_view use,
                       std::string& refusal) {
  const auto channel = scan_channel(input, use, refusal);
  if (!channel) return nullptr;
  if (!plan.channels.empty() && plan.differential != input.differential) {
    refusal =
        "USB-1208FS-Plus: its inputs are all single-ended or all differential; "
        "set the same differential for each of them";
    return nullptr;
  }
  plan.differential = input.differential;
  for (const ScanChannel& other : plan.channels) {
    if (other.channel != channel->channel) continue;
    refusal = "USB-1208FS-Plus: the input " + input.input + " is assigned twice";
    return nullptr;
  }
  return &plan.channels.emplace_back(*channel);
}

bool add_channels(ScanPlan& plan, const config::BenchInputs& inputs, std::string& refusal) {
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (!inputs[i]) continue;
    ScanChannel* added = add_input(plan, *inputs[i], channel_table[i].stem, refusal);
    if (added == nullptr) return false;
    added->frame_index = i;
  }
  if (!plan.channels.empty()) return true;
  refusal = "USB-1208FS-Plus: no channel is assigned to its inputs; assign one in [inputs.CHANNEL]";
  return false;
}

bool add_readback(ScanPlan& plan, const std::optional<config::BenchInput>& input,
                  std::string_view use, std::optional<double> OutputReadings::*output,
                  std::string& refusal) {
  if (!input) return true;
  ScanChannel* added = add_input(plan, *input, use, refusal);
  if (added != nullptr) added->output = output;
  return added != nullptr;
}

}  // namespace

Status status_of(std::uint16_t word) {
  return {(word & 0x02U) != 0, (word & 0x04U) != 0, (word & 0x08U) != 0, (word & 0x10U) != 0};
}

std::optional<Calibration> parse_calibration(std::span<const std::uint8_t> memory) {
  if (memory.size() < calibration_bytes) return std::nullopt;
  Calibration calibration;
  std::size_t at = 0;
  bool valid = true;
  const auto take = [&](Correction& correction) {
    correction = correction_at(memory, at);
    valid = valid && plausible(correction);
    at += 8;
  };
  for (auto& range : calibration.differential) {
    for (Correction& correction : range) take(correction);
  }
  for (Correction& correction : calibration.single_ended) take(correction);
  if (!valid) return std::nullopt;
  return calibration;
}

double input_volts(std::uint16_t code, double range_v, Correction correction) {
  const double calibrated = static_cast<double>(code) * static_cast<double>(correction.slope) +
                            static_cast<double>(correction.offset);
  return (calibrated - 2048.0) * range_v / 2048.0;
}

std::uint16_t output_counts(double volts) {
  if (!(volts > 0.0)) return 0;
  return static_cast<std::uint16_t>(
      std::min(4095.0, std::round(std::min(volts, 5.0) * 4096.0 / 5.0)));
}

std::optional<ScanPlan> plan_scan(const config::BenchInputs& inputs,
                                  const config::ReadbackInputs& outputs, double rate_hz,
                                  std::string& refusal) {
  ScanPlan plan;
  if (!add_channels(plan, inputs, refusal) ||
      !add_readback(plan, outputs.drive_readback, "readback.drive", &OutputReadings::drive_v,
                    refusal) ||
      !add_readback(plan, outputs.enable_readback, "readback.enable", &OutputReadings::enable_v,
                    refusal)) {
    return std::nullopt;
  }
  const double samples_hz = rate_hz * static_cast<double>(plan.channels.size());
  if (!(rate_hz >= 1.0) || samples_hz > max_sample_rate_hz) {
    refusal = "USB-1208FS-Plus: " + physics::counted(plan.channels.size(), "input") + " at " +
              physics::shortest_text(rate_hz) + " Hz; the board samples at most " +
              physics::shortest_text(max_sample_rate_hz) +
              " times a second over all inputs, and each at 1 Hz or more. Change loop.rate_hz";
    return std::nullopt;
  }
  plan.immediate = rate_hz <= max_immediate_rate_hz;
  if (!plan.immediate) fill_packets(plan, rate_hz);
  std::sort(plan.channels.begin(), plan.channels.end(),
            [](const auto& a, const auto& b) { return a.channel < b.channel; });
  const auto count = static_cast<std::uint32_t>(plan.channels.size());
  const auto ticks = static_cast<std::uint32_t>(std::lround(clock_hz / (rate_hz * count)));
  plan.input_pacer = ticks - 1;
  plan.output_pacer = ticks * count - 1;
  plan.period_s = static_cast<double>(ticks) * count / clock_hz;
  const double packets = 0.005 * rate_hz * count / samples_per_packet;
  plan.transfer_bytes = packet_bytes * static_cast<std::size_t>(std::max(1.0, packets));
  return plan;
}

std::array<std::uint8_t, 14> input_scan(const ScanPlan& plan) {
  std::array<std::uint8_t, 14> bytes{};  // total and retrigger count 0: continuous
  put_word(bytes, 8, plan.input_pacer);
  for (const ScanChannel& channel : plan.channels) {
    bytes[12] = static_cast<std::uint8_t>(bytes[12] | (1U << channel.channel));
  }
  bytes[13] = static_cast<std::uint8_t>((plan.immediate ? 1U : 0U) | (plan.differential ? 2U : 0U));
  return bytes;
}

std::array<std::uint8_t, 8> input_ranges(const ScanPlan& plan) {
  std::array<std::uint8_t, 8> bytes{};
  for (const ScanChannel& channel : plan.channels) bytes[channel.channel] = channel.range_code;
  return bytes;
}

std::array<std::uint8_t, 9> output_scan(const ScanPlan& plan, int output) {
  std::array<std::uint8_t, 9> bytes{};
  put_word(bytes, 4, plan.output_pacer);
  bytes[8] = static_cast<std::uint8_t>(1U << static_cast<unsigned>(output));
  return bytes;
}

std::optional<std::span<const std::uint16_t>> ScanDecoder::next(
    std::span<const std::uint8_t>& bytes) {
  const std::size_t wanted = 2 * channels_;
  const std::size_t taken = std::min(wanted - have_, bytes.size());
  std::copy_n(bytes.begin(), taken, bytes_.begin() + static_cast<std::ptrdiff_t>(have_));
  bytes = bytes.subspan(taken);
  have_ += taken;
  if (have_ < wanted) return std::nullopt;
  have_ = 0;
  for (std::size_t i = 0; i < channels_; ++i) {
    codes_[i] = static_cast<std::uint16_t>((bytes_[2 * i] | (bytes_[2 * i + 1] << 8)) & 0x0FFF);
  }
  return std::span<const std::uint16_t>(codes_.data(), channels_);
}

}  // namespace stickslip::drivers::usb_1208fs_plus
