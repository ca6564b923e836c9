// A device that is read beside the board, at its own pace: a strain bridge, an LVDT conditioner, an
// instrument on a serial line. It may take its time: it is read in a thread of its own (see
// bench/gauge_reader.h), which opens it again when it was lost; the loop only looks at what was
// read last. To add such a device is to write one of these: docs/hardware.md shows the smallest.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "drivers/driver.h"

namespace stickslip::drivers {

/// What one input says.
struct Reading {
  double value = 0.0;        ///< in the input's unit
  std::int64_t time_ns = 0;  ///< when it was measured, on the host's monotonic clock
  bool valid = false;        ///< false: the device itself does not believe it
};

/// An input that a gauge was asked to read.
struct GaugeInput {
  std::string device;  ///< the DEVICE of DEVICE/INPUT in the configuration
  std::string name;    ///< the INPUT of it
  std::string unit;    ///< "V/V", "mm"
};

/// What a gauge could not read without saying so itself, since it was opened.
struct GaugeLosses {
  std::uint64_t missing = 0;   ///< readings that should have come and did not
  std::uint64_t rejected = 0;  ///< answers that were not believed: wrong checksum, length, echo
};

/// Lifecycle: open -> read* -> close. All in one thread, but for name and inputs, which do not
/// change, and signals.
class Gauge {
 public:
  Gauge() = default;
  Gauge(const Gauge&) = delete;
  Gauge& operator=(const Gauge&) = delete;
  virtual ~Gauge() = default;

  /// For a person: "PhidgetBridge 1046 #123456".
  virtual const std::string& name() const = 0;
  virtual std::span<const GaugeInput> inputs() const = 0;

  /// Finds the device, sets it, and is ready to read. May take seconds.
  virtual Result open() = 0;

  /// Waits for what comes next, at most a fifth of a second. `readings` are one for each input, in
  /// their order; those of which nothing new is known are left as they are.
  ///   ok               at least one is new
  ///   no_data          nothing came
  ///   temporary        nothing that could be believed came; the next may be well
  ///   needs_attention  a person must do something; it is closed, and opened again with patience
  ///   lost             it is gone; the same
  ///   fatal            it cannot be used again
  virtual Result read(std::span<Reading> readings) = 0;

  virtual void close() noexcept = 0;

  virtual GaugeLosses losses() const { return {}; }

  /// Of an amplifier that says by its bus how it is. Any thread; as cheap as reading a variable.
  virtual Signals signals() const noexcept { return {}; }
};

}  // namespace stickslip::drivers
