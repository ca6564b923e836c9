// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/cp2112/emulated_cp2112.h"

#include <array>

namespace stickslip::emulated {

namespace {

constexpr std::uint8_t report_gpio_config = 2;
constexpr std::uint8_t report_gpio_get = 3;
constexpr std::uint8_t report_gpio_set = 4;
constexpr std::uint8_t report_version = 5;
constexpr std::uint8_t report_smbus_config = 6;
constexpr std::size_t smbus_config_size = 14;  // including the report ID

// Vendor-defined: one input and one feature report suffice for the parser; the others are requested
// by ID.
constexpr std::array<std::uint8_t, 31> report_descriptor = {
    0x06, 0x00, 0xFF, 0x09, 0x01, 0xA1, 0x01, 0x15, 0x00, 0x26, 0xFF, 0x00, 0x75, 0x08, 0x85, 0x02,
    0x95, 0x04, 0x09, 0x01, 0xB1, 0x02, 0x85, 0x13, 0x95, 0x3F, 0x09, 0x01, 0x81, 0x02, 0xC0};
constexpr std::uint8_t report_descriptor_size = report_descriptor.size();

bool bit(std::uint8_t bits, int line) { return ((bits >> line) & 1) != 0; }

}  // namespace

Bytes EmulatedCp2112::device_descriptor() const {
  return {18, 1, 0x00, 0x02, 0, 0, 0, 64, 0xC4, 0x10, 0x90, 0xEA, 0x00, 0x01, 1, 2, 3, 1};
}

Bytes EmulatedCp2112::configuration_descriptor() const {
  return {9,  2,    41,   0,    1,  1, 0,    0x80,
          50,  // configuration
          9,  4,    0,    0,    2,  3, 0,    0,
          0,  // HID interface
          9,  0x21, 0x11, 0x01, 0,  1, 0x22, report_descriptor_size,
          0,                                // HID descriptor
          7,  5,    0x81, 3,    64, 0, 1,   // interrupt in
          7,  5,    0x01, 3,    64, 0, 1};  // interrupt out
}

std::string EmulatedCp2112::string(std::uint8_t index) const {
  switch (index) {
    case 1:
      return "Silicon Laboratories";
    case 2:
      return "CP2112 HID USB-to-SMBus Bridge";
    case 3:
      return "0001";
    default:
      return "";
  }
}

void EmulatedCp2112::reset() {
  const std::lock_guard lock(mutex_);
  outputs_ = push_pull_ = special_ = clock_divider_ = 0;
  latch_ = 0xFF;
  smbus_.assign(smbus_config_size, 0);
  smbus_[0] = report_smbus_config;
  settle();
}

UsbAnswer EmulatedCp2112::control(const UsbSetup& setup, std::span<const std::uint8_t> out) {
  const std::lock_guard lock(mutex_);
  constexpr std::uint8_t get_descriptor = 6;
  constexpr std::uint16_t report_type = 0x2200;
  if (setup.request_type == 0x81 && setup.request == get_descriptor && setup.value == report_type) {
    return {UsbStatus::ok, {report_descriptor.begin(), report_descriptor.end()}};
  }
  if (setup.request_type == 0xA1 && setup.request == 1) {
    return get_report(static_cast<std::uint8_t>(setup.value & 0xFF));
  }
  if (setup.request_type == 0x21 && setup.request == 9) return set_report(out);
  if (setup.request_type == 0x21 && setup.request == 0x0A) return {};  // SET_IDLE
  return {UsbStatus::stall, {}};
}

UsbAnswer EmulatedCp2112::get_report(std::uint8_t id) const {
  switch (id) {
    case report_gpio_config:
      return {UsbStatus::ok, {id, outputs_, push_pull_, special_, clock_divider_}};
    case report_gpio_get:
      return {UsbStatus::ok, {id, levels()}};
    case report_version:
      return {UsbStatus::ok, {id, 0x0C, 0x02}};
    case report_smbus_config:
      return {UsbStatus::ok, smbus_};
    default:
      return {UsbStatus::stall, {}};
  }
}

UsbAnswer EmulatedCp2112::set_report(std::span<const std::uint8_t> report) {
  if (report.empty()) return {UsbStatus::stall, {}};
  if (report[0] == report_gpio_config && report.size() >= 5) {
    outputs_ = report[1];
    push_pull_ = report[2];
    special_ = report[3];
    clock_divider_ = report[4];
  } else if (report[0] == report_gpio_set && report.size() >= 3) {
    latch_ = static_cast<std::uint8_t>((latch_ & ~report[2]) | (report[1] & report[2]));
  } else if (report[0] == report_smbus_config && report.size() >= smbus_config_size) {
    smbus_.assign(report.begin(), report.begin() + smbus_config_size);
  } else {
    return {UsbStatus::stall, {}};
  }
  settle();
  return {};
}

/// Levels: outputs as driven, inputs as connected, others high.
std::uint8_t EmulatedCp2112::levels() const {
  std::uint8_t high = 0xFF;
  const auto pull_down = [&high](std::optional<int> line) {
    if (line) high = static_cast<std::uint8_t>(high & ~(1U << *line));
  };
  pull_down(lines_.enable);
  if (wires_.amplifier_fault()) pull_down(lines_.fault);
  if (wires_.emergency_stop()) pull_down(lines_.emergency_stop);
  for (int line = 0; line < 8; ++line) {
    if (!bit(outputs_, line)) continue;
    const bool driven_high = bit(latch_, line) && bit(push_pull_, line);
    const bool floats = bit(latch_, line) && !bit(push_pull_, line);
    if (floats) continue;
    high = static_cast<std::uint8_t>(driven_high ? high | 1U << line : high & ~(1U << line));
  }
  return high;
}

void EmulatedCp2112::settle() {
  const std::uint8_t now = levels();
  if (lines_.enable) wires_.enable(bit(now, *lines_.enable), now_());
  if (lines_.heartbeat && bit(now, *lines_.heartbeat) != heartbeat_) {
    heartbeat_ = !heartbeat_;
    ++heartbeats_;
  }
}

UsbStatus EmulatedCp2112::out(std::uint8_t, std::span<const std::uint8_t>) { return UsbStatus::ok; }

UsbAnswer EmulatedCp2112::in(std::uint8_t, std::size_t) { return {UsbStatus::not_ready, {}}; }

std::uint64_t EmulatedCp2112::heartbeats() const {
  const std::lock_guard lock(mutex_);
  return heartbeats_;
}

}  // namespace stickslip::emulated
