// SPDX-License-Identifier: Apache-2.0
// A LabJack U6 or U6-Pro as the board of a bench: its inputs are streamed, a DAC drives the shaker,
// and a digital line enables the amplifier.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/attached_device.h"
#include "drivers/clock/host_clock.h"
#include "drivers/driver.h"

namespace stickslip::drivers {

namespace labjack {
class Lines;
}
namespace labjack_u6 {
struct Command;
struct Verdict;
struct StreamCounts;
struct StreamPlan;
}  // namespace labjack_u6

/// A frame is a scan, in volts at the inputs. Its time is exactly its number times the period of
/// the board's crystal; its sequence includes scans lost on the bus or in the board.
/// Actuation.drive is the voltage of the configured DAC, Actuation.amplifier_on the level of the
/// enable line.
///
/// read and write belong to one thread; samples arrive in another, which this object starts.
class LabjackU6Driver final : public Driver {
 public:
  /// `inputs` are those on this board only (input "AIN0" to "AIN13"; differential pairs begin with
  /// an even one; range_v 10, 1, 0.1 or 0.01). `rate_hz` is the scan rate. `clock` must outlive the
  /// driver. Invalid settings are reported by open.
  LabjackU6Driver(const config::LabjackU6& settings, const config::BenchInputs& inputs,
                  double rate_hz, HostClock& clock);
  ~LabjackU6Driver() override;

  /// Finds the board (after the first open: the same one, also without a configured serial), sets
  /// the enable line low before anything else (and again where a later step fails), reads the
  /// calibration, stops a stream left running by a terminated process, and makes the outputs safe:
  /// enable line low, DAC at rest.
  Result open() override;
  Result start() override;
  /// Waits at most 20 ms. The loss of the board, or of the count of scans, is reported until close.
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
  Result prepare();
  Result read_calibration();
  Result set_watchdog(const labjack_u6::Command& command);
  Result begin_stream();
  Result configure_stream(const labjack_u6::StreamPlan& plan, std::uint32_t& lines);
  labjack_u6::Command enable_line_low();
  void hold_enable_line_low() noexcept;
  labjack_u6::Verdict check_echo(std::span<const std::uint8_t> reply) const;
  bool make_safe() noexcept;
  void end_stream() noexcept;
  void note_left_on(const char* why) noexcept;
  Result stream_end();

  config::LabjackU6 settings_;
  config::BenchInputs inputs_;
  double rate_hz_;
  HostClock& clock_;
  Description description_;
  std::unique_ptr<Board> board_;  // null: not open
  std::string serial_at_start_;   // of the first board that was opened; empty: none yet
  std::string refusal_;
  std::string left_on_;  // empty: everything is off
  std::array<char, 200> end_text_{};
  std::atomic<bool> running_{false};
  std::unique_ptr<labjack::Lines> lines_;
  std::unique_ptr<labjack_u6::StreamCounts> counts_;
  double rest_v_;  // drive of the latest "off"; initially that of the settings
  std::uint8_t echo_ = 0;
  OutputReadings outputs_;  // of the latest frame
};

/// Every attached LabJack U6, usable or not.
std::vector<AttachedDevice> find_labjack_u6();

}  // namespace stickslip::drivers
