// SPDX-License-Identifier: Apache-2.0
// A LabJack T7 as the board of a bench, over Ethernet: its inputs are streamed, a DAC drives the
// shaker, and a digital line enables the amplifier.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "config/bench.h"
#include "drivers/clock/host_clock.h"
#include "drivers/driver.h"

namespace stickslip::drivers {

namespace labjack {
class Lines;
}
namespace labjack_t7 {
class Feedback;
struct Problem;
struct StreamCounts;
struct StreamPlan;
}  // namespace labjack_t7

/// A frame is a scan, in volts at the inputs. Its time is exactly its number times the interval of
/// the board's crystal; its sequence includes scans that the board skipped. Actuation.drive is the
/// voltage of the configured DAC, Actuation.amplifier_on the level of the enable line.
///
/// read and write belong to one thread; packets arrive in another, which this object starts.
class LabjackT7Driver final : public Driver {
 public:
  /// `inputs` are those on this board only (input "AIN0" to "AIN13"; differential pairs begin with
  /// an even one; range_v 10, 1, 0.1 or 0.01). `rate_hz` is the scan rate. `clock` must outlive the
  /// driver. Invalid settings are reported by open.
  LabjackT7Driver(const config::LabjackT7& settings, const config::BenchInputs& inputs,
                  double rate_hz, HostClock& clock);
  ~LabjackT7Driver() override;

  /// Connects to the board (after the first open: the same one, also without a configured serial),
  /// sets the enable line low as soon as it is identified (and again where a later step fails),
  /// stops a stream left running by a terminated process, reads the calibration, and makes the
  /// outputs safe: enable line low, DAC at rest, watchdog disabled.
  Result open() override;
  Result start() override;
  /// Waits at most 20 ms. The loss of the connection, or of the count of scans, is reported until
  /// close.
  Result read(Frame& frame) override;
  /// Never waits. While a command is in progress, the newest set-point replaces earlier ones; "off"
  /// is sent immediately in any case. A later write reports the result of a command: after a
  /// failure each returns `temporary` until a command is confirmed.
  Result write(const Actuation& actuation) override;
  void stop() noexcept override;
  void close() noexcept override;
  const Description& description() const override { return description_; }
  /// Updated by every command, and at least every 20 ms while read or write is called; where a
  /// reply is missing, requested again after 50 ms. Any thread. While started, a configured line
  /// counts as active (pressed, fault) if no command of the last 100 ms was answered; the start
  /// counts as an answer.
  Signals signals() const noexcept override;
  OutputReadings output_readings() const noexcept override { return outputs_; }
  const char* left_on() const noexcept override {
    return left_on_.empty() ? nullptr : left_on_.c_str();
  }
  Counts counts() const noexcept override;

 private:
  struct Board;

  Result refuse(Outcome outcome, std::string text);
  Result refuse(labjack_t7::Problem problem);
  Result prepare();
  Result stop_stream();
  Result read_calibration();
  Result disarm_watchdog();
  Result begin_stream();
  Result configure(const labjack_t7::StreamPlan& plan, std::uint32_t& lines);
  Result start_stream(labjack_t7::StreamPlan& plan);
  void hold_enable_line_low() noexcept;
  bool make_safe() noexcept;
  void end_stream() noexcept;
  void note_left_on(const char* why) noexcept;
  Result stream_end();

  config::LabjackT7 settings_;
  config::BenchInputs inputs_;
  double rate_hz_;
  HostClock& clock_;
  Description description_;
  std::unique_ptr<Board> board_;       // null: not open
  std::uint32_t serial_at_start_ = 0;  // of the first board that was opened; 0: none yet
  std::string refusal_;
  std::string left_on_;  // empty: everything is off
  std::array<char, 320> end_text_{};
  std::atomic<bool> running_{false};
  std::unique_ptr<labjack::Lines> lines_;
  std::unique_ptr<labjack_t7::StreamCounts> counts_;
  double rest_v_;           // drive of the latest "off"; initially that of the settings
  OutputReadings outputs_;  // of the latest frame
};

}  // namespace stickslip::drivers
