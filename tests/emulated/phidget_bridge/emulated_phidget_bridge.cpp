// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/phidget_bridge/emulated_phidget_bridge.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace stickslip::emulated {

namespace {

constexpr std::int64_t step_ns = 8'000'000;
constexpr int max_steps = 125;  // 1000 ms
constexpr int reports_of_the_bug = 32;
constexpr std::size_t smallest_input_report = 18;
constexpr std::size_t smallest_output_report = 5;
constexpr double zero_count = 8388608.0;
constexpr double largest_count = 16777215.0;

bool gain_exists(unsigned code) { return code == 0 || (code >= 3 && code <= 7); }
double gain_of(std::uint8_t code) { return code == 0 ? 1.0 : static_cast<double>(1U << code); }

Bytes first_of(Bytes bytes, std::size_t most) {
  bytes.resize(std::min(bytes.size(), most));
  return bytes;
}

}  // namespace

EmulatedPhidgetBridge::EmulatedPhidgetBridge(Options options, Wires& wires, Now now)
    : options_(std::move(options)),
      wires_(wires),
      now_(std::move(now)),
      noise_(options_.seed),
      fate_(options_.seed + 1) {
  options_.input_report_bytes = std::max(options_.input_report_bytes, smallest_input_report);
  options_.output_report_bytes = std::max(options_.output_report_bytes, smallest_output_report);
  reset();
}

Bytes EmulatedPhidgetBridge::device_descriptor() const {
  const auto release = options_.release.value_or(
      static_cast<std::uint16_t>(options_.firmware / 100 << 8 | options_.firmware % 100));
  return {18,
          1,
          0x00,
          0x02,
          0,
          0,
          0,
          64,
          0xC2,
          0x06,
          0x3B,
          0x00,
          static_cast<std::uint8_t>(release & 0xFF),
          static_cast<std::uint8_t>(release >> 8),
          1,
          2,
          3,
          1};
}

Bytes EmulatedPhidgetBridge::hid_descriptor() const {
  const auto length = static_cast<std::uint8_t>(report_descriptor().size());
  return {9, 0x21, 0x11, 0x01, 0, 1, 0x22, length, 0};
}

Bytes EmulatedPhidgetBridge::report_descriptor() const {
  const auto in = static_cast<std::uint8_t>(options_.input_report_bytes);
  const auto out = static_cast<std::uint8_t>(options_.output_report_bytes);
  return {
      0x06, 0xA0, 0xFF,                    // usage page: the vendor's
      0x09, 0x01,                          // usage 1
      0xA1, 0x01,                          // collection: application
      0x15, 0x00, 0x26, 0xFF, 0x00,        //   0 to 255
      0x75, 0x08,                          //   8 bits
      0x95, in,   0x09, 0x02, 0x81, 0x02,  //   input report
      0x95, out,  0x09, 0x03, 0x91, 0x02,  //   output report
      0xC0,
  };
}

Bytes EmulatedPhidgetBridge::configuration_descriptor() const {
  Bytes bytes{9, 2, 0, 0, 1, 1, 0, 0x80, 250};
  const std::uint8_t endpoints = options_.out_endpoint ? 2 : 1;
  const Bytes interface { 9, 4, 0, 0, endpoints, 3, 0, 0, 0 };
  bytes.insert(bytes.end(), interface.begin(), interface.end());
  const Bytes hid = hid_descriptor();
  bytes.insert(bytes.end(), hid.begin(), hid.end());
  const Bytes in{7, 5, 0x81, 3, 64, 0, 1};
  bytes.insert(bytes.end(), in.begin(), in.end());
  if (options_.out_endpoint) {
    const Bytes out{7, 5, 0x01, 3, 64, 0, 1};
    bytes.insert(bytes.end(), out.begin(), out.end());
  }
  bytes[2] = static_cast<std::uint8_t>(bytes.size());
  return bytes;
}

std::string EmulatedPhidgetBridge::string(std::uint8_t index) const {
  switch (index) {
    case 1:
      return "Phidgets Inc.";
    case 2:
      return "PhidgetBridge 4-input";
    case 3:
      return options_.serial;
    default:
      return {};
  }
}

UsbAnswer EmulatedPhidgetBridge::control(const UsbSetup& setup, std::span<const std::uint8_t> out) {
  catch_up();
  const auto is = [&setup](std::uint8_t type, std::uint8_t request) {
    return setup.request_type == type && setup.request == request;
  };
  if (is(0x81, 0x06) && setup.value == 0x2200) {
    return {UsbStatus::ok, first_of(report_descriptor(), setup.length)};
  }
  if (is(0x81, 0x06) && setup.value == 0x2100) {
    return {UsbStatus::ok, first_of(hid_descriptor(), setup.length)};
  }
  if (is(0x21, 0x0A)) return {};  // SET_IDLE: without effect on the interval
  if (is(0xA1, 0x01) && setup.value == 0x0100 && !latest_.empty()) {
    return {UsbStatus::ok, first_of(latest_, setup.length)};
  }
  if (is(0x21, 0x09) && setup.value == 0x0200 && out.size() >= smallest_output_report) {
    apply(out);
    return {};
  }
  return {UsbStatus::stall, {}};
}

UsbStatus EmulatedPhidgetBridge::out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) {
  catch_up();
  if (endpoint != 1 || !options_.out_endpoint) return UsbStatus::stall;
  if (bytes.size() >= smallest_output_report) apply(bytes);
  return UsbStatus::ok;
}

UsbAnswer EmulatedPhidgetBridge::in(std::uint8_t endpoint, std::size_t capacity) {
  catch_up();
  if (endpoint != 1) return {UsbStatus::stall, {}};
  if (faults.stall) {
    faults.stall = false;
    halted_ = true;
    ++injected_.stall;
  }
  if (halted_) return {UsbStatus::stall, {}};
  if (waiting_.empty()) return {UsbStatus::not_ready, {}};
  Bytes report = first_of(std::move(waiting_.front()), capacity);
  waiting_.pop_front();
  return {UsbStatus::ok, std::move(report)};
}

void EmulatedPhidgetBridge::clear_halt(std::uint8_t endpoint_address) {
  if (endpoint_address == 0x81) halted_ = false;
}

void EmulatedPhidgetBridge::reset() {
  settings_ = {};
  if (options_.own_interval_ms) settings_.interval_steps = *options_.own_interval_ms / 8;
  gain_in_force_ = {};
  first_sample_ = {};
  reports_until_gain_ = 0;
  waiting_.clear();
  latest_.clear();
  halted_ = false;
  next_report_ns_ = now_() + step_ns;
}

/// Unsupported settings are ignored, which the echo shows.
void EmulatedPhidgetBridge::apply(std::span<const std::uint8_t> bytes) {
  const auto enabled_now = static_cast<std::uint8_t>(bytes[0] & 0x0FU);
  for (std::size_t i = 0; i < inputs; ++i) {
    if ((enabled_now >> i & 1U) != 0 && !enabled(i)) first_sample_[i] = true;
    const std::uint8_t pair = bytes[1 + i / 2];
    const auto code = static_cast<std::uint8_t>(i % 2 == 0 ? pair >> 4U : pair & 0x0FU);
    if (!gain_exists(code) || code == settings_.gain_code[i]) continue;
    settings_.gain_code[i] = code;
    reports_until_gain_ = reports_of_the_bug;
  }
  settings_.enabled = enabled_now;
  if (!has_gain_bug()) gain_in_force_ = settings_.gain_code;
  if (options_.own_interval_ms) return;
  const int steps = bytes[3] | (bytes[4] & 3) << 8;
  if (steps < 1 || steps > max_steps || steps == settings_.interval_steps) return;
  settings_.interval_steps = steps;
  next_report_ns_ = now_() + steps * step_ns;
}

void EmulatedPhidgetBridge::catch_up() {
  const std::int64_t now_ns = now_();
  while (next_report_ns_ <= now_ns) {
    report(next_report_ns_);
    next_report_ns_ += settings_.interval_steps * step_ns;
  }
}

void EmulatedPhidgetBridge::report(std::int64_t time_ns) {
  latest_ = content(time_ns);
  ++reports_made_;
  settle_gains();
  if (faults.silent || chance(faults.missing, injected_.missing)) return;
  if (waiting_.size() >= options_.kept_reports) {
    waiting_.pop_front();
    ++injected_.overwritten;
  }
  Bytes bytes = latest_;
  if (chance(faults.invalid, injected_.invalid)) bytes[0] = bytes[0] & 0x0FU;
  if (chance(faults.out_of_range, injected_.out_of_range)) bytes[1] = 0x0F;
  if (chance(faults.wrong_echo, injected_.wrong_echo)) bytes[2] = bytes[2] ^ 0x30U;
  if (chance(faults.short_report, injected_.short_report)) bytes.resize(5);
  waiting_.push_back(std::move(bytes));
}

Bytes EmulatedPhidgetBridge::content(std::int64_t time_ns) {
  Bytes bytes(options_.input_report_bytes, 0);
  const auto& code = settings_.gain_code;
  bytes[0] = settings_.enabled;
  bytes[2] = static_cast<std::uint8_t>(code[0] << 4U | code[1]);
  bytes[3] = static_cast<std::uint8_t>(code[2] << 4U | code[3]);
  bytes[4] = static_cast<std::uint8_t>(settings_.interval_steps >> 8);
  bytes[5] = static_cast<std::uint8_t>(settings_.interval_steps & 0xFF);
  if (!options_.states_interval) bytes[4] = bytes[5] = 0xFF;
  for (std::size_t i = 0; i < inputs; ++i) {
    if (!enabled(i)) continue;
    const bool first = std::exchange(first_sample_[i], false);
    bool beyond = false;
    std::uint32_t raw = sample(i, time_ns, beyond);
    // The converter has not settled: half of the value. Newer firmware suppresses this sample.
    if (first) raw = raw / 2;
    if (!first || has_gain_bug()) bytes[0] = static_cast<std::uint8_t>(bytes[0] | 0x10U << i);
    if (beyond) bytes[1] = static_cast<std::uint8_t>(bytes[1] | 1U << i);
    for (std::size_t k = 0; k < 3; ++k) {
      bytes[6 + 3 * i + k] = static_cast<std::uint8_t>(raw >> (16 - 8 * k));
    }
  }
  return bytes;
}

/// 24 bits, offset binary.
std::uint32_t EmulatedPhidgetBridge::sample(std::size_t input, std::int64_t time_ns, bool& beyond) {
  double ratio = 0.0;
  if (const auto& sensor = options_.sensors[input]) ratio = (*sensor)(wires_, time_ns);
  if (options_.noise_v_per_v > 0.0) {
    ratio += std::normal_distribution<double>(0.0, options_.noise_v_per_v)(noise_);
  }
  const double count = std::round(zero_count * (1.0 + ratio * gain_of(gain_in_force_[input])));
  beyond = !(count >= 0.0 && count <= largest_count);
  return static_cast<std::uint32_t>(std::clamp(count, 0.0, largest_count));
}

void EmulatedPhidgetBridge::settle_gains() {
  if (reports_until_gain_ == 0) return;
  if (has_gain_bug() && !enabled(0)) return;
  if (--reports_until_gain_ == 0) gain_in_force_ = settings_.gain_code;
}

bool EmulatedPhidgetBridge::chance(double probability, std::uint64_t& count) {
  if (probability <= 0.0) return false;
  const bool strikes = std::uniform_real_distribution<double>(0.0, 1.0)(fate_) < probability;
  if (strikes) ++count;
  return strikes;
}

}  // namespace stickslip::emulated
