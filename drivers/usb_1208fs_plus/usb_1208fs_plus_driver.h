// SPDX-License-Identifier: Apache-2.0
// Measurement Computing USB-1208FS-Plus: inputs of 11 or 12 bits, scanned by the board's clock, and
// an output of 12 bits paced by the same clock.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/attached_device.h"
#include "drivers/clock/host_clock.h"
#include "drivers/driver.h"
#include "drivers/usb_1208fs_plus/protocol.h"

namespace stickslip::drivers {

namespace usb_1208fs_plus {
class Board;
class Session;
}  // namespace usb_1208fs_plus

/// Frames hold volts, by the board's own calibration. The inputs of a scan are converted one after
/// the other, spread over its whole period: a frame's time is that of its last channel, and the
/// ages of the others are relative to it.
///
/// The board does not number scans. After lost scans (an overrun, signalled by a stalled endpoint)
/// or a short packet the scan is restarted, `sequence` advances by the number of periods between
/// the starts on the host's clock, rounded, and the next read returns `temporary` once: the number
/// of lost scans is known to about a millisecond, not exactly.
///
/// write() takes volts (0 to 5) for the output. They are queued in the board for
/// settings.output_ahead_s and leave it at the pace of the scans: one value for each frame that was
/// read, so that a late cycle causes no discontinuity. An output that ran dry holds its last value
/// until the next write and then begins again with the original delay. With amplifier_on = false
/// the queue is discarded and the output goes to `drive` (the rest voltage) immediately. The
/// amplifier's enable contact is not on this board: see [amplifier].
class Usb1208fsPlusDriver final : public Driver {
 public:
  /// `inputs` are those on this board only. `clock` must outlive the driver.
  Usb1208fsPlusDriver(const config::Usb1208fsPlus& settings, const config::BenchInputs& inputs,
                      double rate_hz, HostClock& clock);
  ~Usb1208fsPlusDriver() override;

  Result open() override;
  Result start() override;
  /// Waits at most 20 ms.
  Result read(Frame& frame) override;
  Result write(const Actuation& actuation) override;
  /// Sets the output to the voltage of the last write without the amplifier, initially
  /// settings.rest_v. Returns within seconds, even if the kernel does not return transfers: the
  /// board then counts as lost, and close() leaves their memory to the kernel.
  void stop() noexcept override;
  void close() noexcept override;
  const Description& description() const override { return description_; }
  OutputReadings output_readings() const noexcept override { return outputs_; }

  const char* left_on() const noexcept override {
    return left_on_.empty() ? nullptr : left_on_.c_str();
  }
  Counts counts() const noexcept override;
  /// Restarts of the input scan, over the life of the driver.
  std::uint64_t overruns() const noexcept { return overruns_.load(std::memory_order_relaxed); }
  /// Underruns of the output, over the life of the driver.
  std::uint64_t underruns() const noexcept { return underruns_.load(std::memory_order_relaxed); }

 private:
  using CalibrationMemory = std::array<std::uint8_t, usb_1208fs_plus::calibration_bytes>;

  Result refuse(Outcome outcome, std::string text);
  Result read_calibration(const usb_1208fs_plus::Session& session, CalibrationMemory& memory);
  bool queue_drive(std::uint16_t counts);

  config::Usb1208fsPlus settings_;
  config::BenchInputs inputs_;
  double rate_hz_;
  HostClock& clock_;
  Description description_;
  std::string serial_at_start_;  // of the first board that was opened; empty: none yet
  std::string refusal_;
  std::string left_on_;  // empty: the output is at rest
  std::atomic<std::uint64_t> overruns_{0};
  std::atomic<std::uint64_t> underruns_{0};
  std::unique_ptr<usb_1208fs_plus::Board> board_;  // null: not open

  // Of the loop's thread, since the board was opened.
  OutputReadings outputs_;  // of the latest frame
  std::uint64_t written_sequence_ = 0;
  std::uint64_t read_sequence_ = 0;
  bool was_driving_ = false;
  std::size_t held_back_ = 0;  // writes since the output ran dry
};

/// Every attached board of this kind.
std::vector<AttachedDevice> find_usb_1208fs_plus();

}  // namespace stickslip::drivers
