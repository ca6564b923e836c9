// SPDX-License-Identifier: Apache-2.0
#include "drivers/phidget_bridge/protocol.h"

#include <algorithm>
#include <cmath>

namespace stickslip::drivers::phidget_bridge {

namespace {

struct GainCode {
  int gain;
  std::uint8_t code;
};
constexpr std::array<GainCode, 6> gain_codes = {
    {{1, 0}, {8, 3}, {16, 4}, {32, 5}, {64, 6}, {128, 7}}};

constexpr std::uint32_t zero = 0x800000;
constexpr double usable_part_of_range = 0.995;

std::uint8_t code_of(int gain) {
  for (const GainCode& one : gain_codes) {
    if (one.gain == gain) return one.code;
  }
  return 0;
}

std::optional<int> gain_of(unsigned code) {
  for (const GainCode& one : gain_codes) {
    if (one.code == code) return one.gain;
  }
  return std::nullopt;
}

}  // namespace

bool is_gain(int gain) {
  return std::any_of(gain_codes.begin(), gain_codes.end(),
                     [gain](const GainCode& one) { return one.gain == gain; });
}

bool is_interval(int interval_ms) {
  return interval_ms >= 8 && interval_ms <= 1000 && interval_ms % 8 == 0;
}

std::array<std::uint8_t, output_bytes> output_report(const Settings& settings) {
  std::array<std::uint8_t, output_bytes> bytes{};
  for (unsigned i = 0; i < input_count; ++i) {
    if (settings.enabled[i]) bytes[0] = static_cast<std::uint8_t>(bytes[0] | (1U << i));
    const unsigned shift = i % 2 == 0 ? 4 : 0;
    std::uint8_t& gains = bytes[1 + i / 2];
    gains = static_cast<std::uint8_t>(gains | (unsigned{code_of(settings.gain[i])} << shift));
  }
  const auto eighths = static_cast<unsigned>(settings.interval_ms / 8);
  bytes[3] = static_cast<std::uint8_t>(eighths & 0xFFU);
  bytes[4] = static_cast<std::uint8_t>((eighths >> 8U) & 0x03U);
  return bytes;
}

std::optional<InputReport> parse_input(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < input_bytes) return std::nullopt;
  InputReport report;
  for (unsigned i = 0; i < input_count; ++i) {
    report.settings.enabled[i] = (bytes[0] >> i & 1U) != 0;
    report.measured[i] = (bytes[0] >> (4U + i) & 1U) != 0;
    report.error[i] = (bytes[1] >> i & 1U) != 0;
    const auto gain = gain_of(bytes[2 + i / 2] >> (i % 2 == 0 ? 4U : 0U) & 0x0FU);
    if (!gain) return std::nullopt;
    report.settings.gain[i] = *gain;
    const std::size_t at = 6 + 3 * std::size_t{i};
    report.raw[i] = std::uint32_t{bytes[at]} << 16U | std::uint32_t{bytes[at + 1]} << 8U |
                    std::uint32_t{bytes[at + 2]};
  }
  report.settings.interval_ms = 8 * ((bytes[4] & 0x03) << 8 | bytes[5]);
  return report;
}

double ratio(std::uint32_t raw, int gain) {
  return (static_cast<double>(raw) - static_cast<double>(zero)) / static_cast<double>(zero) / gain;
}

bool is_valid(const InputReport& report, std::size_t input) {
  const int gain = report.settings.gain[input];
  return report.settings.enabled[input] && report.measured[input] && !report.error[input] &&
         std::abs(ratio(report.raw[input], gain)) <= usable_part_of_range / gain;
}

std::size_t output_report_bytes(std::span<const std::uint8_t> descriptor) {
  // Items of the descriptor: a prefix (tag, type, size) and up to four bytes.
  constexpr unsigned report_size = 0x74;
  constexpr unsigned report_count = 0x94;
  constexpr unsigned output = 0x90;
  constexpr unsigned long_item = 0xFE;
  std::uint64_t size_bits = 0;
  std::uint64_t count = 0;
  std::uint64_t bits = 0;
  for (std::size_t at = 0; at < descriptor.size();) {
    const unsigned prefix = descriptor[at];
    if (prefix == long_item) return 0;
    const std::size_t length = (prefix & 3U) == 3U ? 4 : prefix & 3U;
    if (at + 1 + length > descriptor.size()) return 0;
    std::uint32_t value = 0;
    for (std::size_t i = length; i-- > 0;) value = value << 8U | descriptor[at + 1 + i];
    const unsigned tag = prefix & 0xFCU;
    if (tag == report_size) size_bits = value;
    if (tag == report_count) count = value;
    if (tag == output) {
      if (size_bits > 32 || count > 4096) return 0;
      bits += size_bits * count;
    }
    at += 1 + length;
  }
  const std::uint64_t bytes = (bits + 7) / 8;
  return bytes <= 4096 ? static_cast<std::size_t>(bytes) : 0;
}

// Handshake

Handshake::Handshake(const Settings& wanted, int firmware)
    : wanted_(wanted), sent_(wanted), gain_bug_(firmware < firmware_without_gain_bug) {
  begin();
}

void Handshake::begin() {
  Settings first = wanted_;
  if (gain_bug_) {
    first.enabled[0] = true;
    first.interval_ms = 8;
  }
  phase_ = Phase::echo;
  send(first);
}

void Handshake::send(const Settings& settings) {
  sent_ = settings;
  reports_ = 0;
  readings_ = {};
  send_ = true;
}

std::optional<std::array<std::uint8_t, output_bytes>> Handshake::to_send() {
  if (!send_) return std::nullopt;
  send_ = false;
  return output_report(sent_);
}

void Handshake::take(const InputReport& report) {
  if (send_) return;  // older than the report still to be sent
  const bool echoed =
      report.settings.enabled == sent_.enabled && report.settings.gain == sent_.gain;
  if (!echoed) {
    // An old report if before the echo; otherwise the board has lost its settings.
    if (phase_ == Phase::done || phase_ == Phase::first_sample || phase_ == Phase::gain_bug)
      begin();
    return;
  }
  switch (phase_) {
    case Phase::echo:
      reports_ = 0;
      phase_ = gain_bug_ ? Phase::gain_bug : Phase::first_sample;
      break;
    case Phase::gain_bug:
      if (++reports_ < reports_of_gain_bug) break;
      phase_ = Phase::last_echo;
      send(wanted_);
      return;
    case Phase::last_echo:
      phase_ = Phase::first_sample;
      break;
    case Phase::first_sample:
      phase_ = Phase::done;
      break;
    case Phase::done:
      break;
  }
  for (std::size_t i = 0; i < input_count; ++i) {
    if (report.measured[i]) readings_[i] = std::min(2, readings_[i] + 1);
  }
}

// GapCounter

std::uint64_t GapCounter::count(std::int64_t time_ns, std::uint64_t reports) {
  const auto interval = static_cast<double>(interval_ns_);
  if (!started_) {
    started_ = true;
    origin_ns_ = time_ns;
    due_ns_ = 0.0;
    return 0;
  }
  const double time = static_cast<double>(time_ns - origin_ns_);
  // A report is late by less than three quarters of an interval, or early by a quarter, as the
  // first one may have been late.
  const double elapsed = std::floor((time - due_ns_) / interval + 0.25);
  const double due = std::max(static_cast<double>(reports), elapsed);
  due_ns_ += due * interval;
  const double late = time - due_ns_;
  // An earlier arrival than expected corrects the due time immediately, a later one only slowly, at
  // the rate of crystal drift.
  due_ns_ += late < 0.0 ? late : 0.005 * late;
  return static_cast<std::uint64_t>(due) - reports;
}

}  // namespace stickslip::drivers::phidget_bridge
