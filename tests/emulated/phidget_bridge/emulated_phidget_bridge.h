// A PhidgetBridge 4-Input 1046 that only looks real: a HID device without report numbers.
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

/// Reports go out at the interval of its own clock, whether or not an input is enabled, and each
/// repeats the settings that are in force. Like the real one it knows neither a number nor a time
/// of a report.
class EmulatedPhidgetBridge final : public UsbDevice {
 public:
  static constexpr std::size_t inputs = 4;

  struct Options {
    std::string serial = "123456";
    /// 100 and 101: a new gain takes hold only after input 0 has been enabled for 32 reports, and
    /// nothing in the reports says so; the first sample after enabling is wrong.
    int firmware = 102;
    std::array<std::optional<Sensor>, inputs> sensors;  ///< in V/V; nothing: 0 V/V
    double noise_v_per_v = 0.0;                         ///< standard deviation, at the input
    std::uint64_t seed = 1;                             ///< of noise and of faults
    std::size_t input_report_bytes = 20;                ///< at least 18
    std::size_t output_report_bytes = 8;                ///< at least 5
    /// Settings come by interrupt endpoint 1; else by SET_REPORT only.
    bool out_endpoint = true;
    /// Reports that wait for a host that is late; the oldest are dropped.
    std::size_t kept_reports = 4;
  };

  /// Each is the probability that it befalls a report; 1: every one.
  struct Faults {
    double missing = 0.0;
    double short_report = 0.0;  ///< 5 bytes of it
    double invalid = 0.0;       ///< no valid bit is set
    double out_of_range = 0.0;  ///< all error bits are set
    double wrong_echo = 0.0;    ///< the gain of input 0 is repeated wrongly
    bool stall = false;         ///< the endpoint stalls once, until it is cleared
    bool silent = false;        ///< no report at all
  };

  /// How many reports each has befallen.
  struct Struck {
    std::uint64_t missing = 0;
    std::uint64_t short_report = 0;
    std::uint64_t invalid = 0;
    std::uint64_t out_of_range = 0;
    std::uint64_t wrong_echo = 0;
    std::uint64_t stall = 0;
    std::uint64_t overwritten = 0;  ///< the host came too late for them; no fault of the device
  };

  EmulatedPhidgetBridge(Options options, Wires& wires, Now now);

  /// To be set at any time between two calls.
  Faults faults;
  const Struck& struck() const { return struck_; }
  std::uint64_t reports_made() const { return reports_made_; }
  bool enabled(std::size_t input) const { return (settings_.enabled >> input & 1U) != 0; }
  int interval_ms() const { return settings_.interval_steps * 8; }

  Bytes device_descriptor() const override;
  Bytes configuration_descriptor() const override;
  std::string string(std::uint8_t index) const override;
  UsbAnswer control(const UsbSetup& setup, std::span<const std::uint8_t> out) override;
  UsbStatus out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) override;
  UsbAnswer in(std::uint8_t endpoint, std::size_t room) override;
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
  std::array<std::uint8_t, inputs> gain_in_force_{};  // differs while the bug is at work
  int reports_until_gain_ = 0;
  std::array<bool, inputs> first_sample_{};  // the next is the first since enabling
  std::int64_t next_report_ns_ = 0;
  std::deque<Bytes> waiting_;
  Bytes latest_;
  bool halted_ = false;
  std::mt19937_64 noise_;
  std::mt19937_64 fate_;
  Struck struck_;
  std::uint64_t reports_made_ = 0;
};

}  // namespace stickslip::emulated
