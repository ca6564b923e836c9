// SPDX-License-Identifier: Apache-2.0
// An emulated PhidgetBridge 4-Input 1046: a HID device without report IDs.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <random>
#include <string>

#include "tests/emulated/usb_device.h"
#include "tests/emulated/wires.h"

namespace stickslip::emulated {

/// Sends reports at the interval of its own clock, even without an enabled input; each repeats the
/// active settings. Like the real one it has neither report numbers nor times.
class EmulatedPhidgetBridge final : public UsbDevice {
 public:
  static constexpr std::size_t inputs = 4;

  struct Options {
    std::string serial = "123456";
    /// 100 and 101: a new gain takes effect only after input 0 has been enabled for 32 reports,
    /// which the reports do not show; the first sample after enabling is wrong.
    int firmware = 102;
    std::optional<std::uint16_t> release;  ///< bcdDevice; absent: that of the firmware
    std::optional<int> own_interval_ms;    ///< kept, whatever is requested
    bool states_interval = true;           ///< false: the field of the interval is FFFF
    std::array<std::optional<Sensor>, inputs> sensors;  ///< in V/V; absent: 0 V/V
    double noise_v_per_v = 0.0;                         ///< standard deviation, at the input
    std::uint64_t seed = 1;                             ///< of noise and of faults
    std::size_t input_report_bytes = 20;                ///< at least 18
    std::size_t output_report_bytes = 8;                ///< at least 5
    /// Accepts settings by interrupt endpoint 1; otherwise by SET_REPORT only.
    bool out_endpoint = true;
    /// Reports buffered for a late host; the oldest are dropped.
    std::size_t kept_reports = 4;
  };

  /// Probabilities per report.
  struct Faults {
    double missing = 0.0;
    double short_report = 0.0;  ///< truncated to 5 bytes
    double invalid = 0.0;       ///< no valid bit is set
    double out_of_range = 0.0;  ///< all error bits are set
    double wrong_echo = 0.0;    ///< the echoed gain of input 0 is wrong
    bool stall = false;         ///< the endpoint stalls once, until it is cleared
    bool silent = false;        ///< no reports
  };

  /// Numbers of affected reports.
  struct InjectedFaults {
    std::uint64_t missing = 0;
    std::uint64_t short_report = 0;
    std::uint64_t invalid = 0;
    std::uint64_t out_of_range = 0;
    std::uint64_t wrong_echo = 0;
    std::uint64_t stall = 0;
    std::uint64_t overwritten = 0;  ///< dropped for a late host; no fault of the device
  };

  EmulatedPhidgetBridge(Options options, Wires& wires, Now now);

  /// May be changed between calls.
  Faults faults;
  const InjectedFaults& injected() const { return injected_; }
  std::uint64_t reports_made() const { return reports_made_; }
  bool enabled(std::size_t input) const { return (settings_.enabled >> input & 1U) != 0; }
  int interval_ms() const { return settings_.interval_steps * 8; }

  Bytes device_descriptor() const override;
  Bytes configuration_descriptor() const override;
  std::string string(std::uint8_t index) const override;
  UsbAnswer control(const UsbSetup& setup, std::span<const std::uint8_t> out) override;
  UsbStatus out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) override;
  UsbAnswer in(std::uint8_t endpoint, std::size_t capacity) override;
  void clear_halt(std::uint8_t endpoint_address) override;
  void reset() override;

 private:
  struct Settings {
    std::uint8_t enabled = 0;
    std::array<std::uint8_t, inputs> gain_code{};
    int interval_steps = 1;  // of 8 ms
  };

  void catch_up();
  void report(std::int64_t time_ns);
  Bytes content(std::int64_t time_ns);
  std::uint32_t sample(std::size_t input, std::int64_t time_ns, bool& beyond);
  void settle_gains();
  void apply(std::span<const std::uint8_t> bytes);
  bool chance(double probability, std::uint64_t& count);
  bool has_gain_bug() const { return options_.firmware < 102; }
  Bytes report_descriptor() const;
  Bytes hid_descriptor() const;

  Options options_;
  Wires& wires_;
  Now now_;
  Settings settings_;
  std::array<std::uint8_t, inputs> gain_in_force_{};  // differs during the gain bug
  int reports_until_gain_ = 0;
  std::array<bool, inputs> first_sample_{};  // the next sample is the first since enabling
  std::int64_t next_report_ns_ = 0;
  std::deque<Bytes> waiting_;
  Bytes latest_;
  bool halted_ = false;
  std::mt19937_64 noise_;
  std::mt19937_64 fate_;
  InjectedFaults injected_;
  std::uint64_t reports_made_ = 0;
};

}  // namespace stickslip::emulated
