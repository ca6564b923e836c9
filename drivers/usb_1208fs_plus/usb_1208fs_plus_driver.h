// Measurement Computing USB-1208FS-Plus: inputs of 11 or 12 bits, scanned by the board's clock, and
// an output of 12 bits that the same clock paces.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/attached.h"
#include "drivers/driver.h"
#include "drivers/host_clock.h"

namespace stickslip::drivers {

/// Frames hold volts, by the board's own calibration. A scan's inputs are converted one after the
/// other, spread over its whole period: a frame's time is that of its last channel, and the ages of
/// the others say how much earlier they were.
///
/// The board numbers nothing. Where it loses scans (an overrun, which it tells by a stalled
/// endpoint) or a packet comes short, the scan is begun anew, `sequence` jumps by the periods that
/// the host's clock counted from start to start, rounded, and the next read answers `temporary`
/// once: such a loss is known to within the periods of a millisecond, not exactly.
///
/// write() takes volts (0 to 5) for the output. They are queued in the board for
/// settings.output_ahead_s and come out at the pace of the scans: one value for each frame that was
/// read, so that a cycle that comes late tears nothing. An output that ran dry holds its last value
/// until the next write, and then begins again as late as before. With amplifier_on = false the
/// queue is thrown away and the output goes to `drive` (the voltage of rest) at once. The board has
/// no line for the amplifier's enable contact here: see [amplifier].
class Usb1208fsPlusDriver final : public Driver {
 public:
  /// `inputs` holds those of this board alone. `clock` must outlive the driver.
  Usb1208fsPlusDriver(const config::Usb1208fsPlus& settings, const config::BenchInputs& inputs,
                      double rate_hz, HostClock& clock);
  ~Usb1208fsPlusDriver() override;

  Result open() override;
  Result start() override;
  /// Waits at most 20 ms.
  Result read(Frame& frame) override;
  Result write(const Actuation& actuation) override;
  /// The output goes to the voltage of the last write without the amplifier, settings.rest_v if
  /// there was none. Within seconds, even where the kernel does not give transfers back: the board
  /// counts as lost then, and close() leaves to the kernel what it keeps.
  void stop() noexcept override;
  void close() noexcept override;
  const Description& description() const override { return description_; }

  const char* left_on() const noexcept override {
    return left_on_.empty() ? nullptr : left_on_.c_str();
  }
  Counts counts() const noexcept override;
  /// How often the scan of the inputs had to be begun anew, of all times that it was open.
  std::uint64_t overruns() const noexcept { return overruns_.load(std::memory_order_relaxed); }
  /// How often the output ran dry.
  std::uint64_t underruns() const noexcept { return underruns_.load(std::memory_order_relaxed); }

 private:
  class Board;
  config::Usb1208fsPlus settings_;
  config::BenchInputs inputs_;
  double rate_hz_;
  HostClock& clock_;
  Description description_;
  std::string refusal_;
  std::string left_on_;                     // empty: the output rests
  std::atomic<std::uint64_t> overruns_{0};  // they outlive the board, which counts in them
  std::atomic<std::uint64_t> underruns_{0};
  std::unique_ptr<Board> board_;
};

/// Every board of this kind on the host's USB.
std::vector<Attached> find_usb_1208fs_plus();

}  // namespace stickslip::drivers
