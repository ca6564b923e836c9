// SPDX-License-Identifier: Apache-2.0
// Interface of a device that is read in addition to the board, at its own rate: a strain-gauge
// bridge, an LVDT conditioner, an instrument on a serial line. Its reads may block: a separate
// thread (see bench/gauge_reader.h) reads it and reopens it after a loss; the loop uses the latest
// reading. A new device of this kind implements this interface: docs/hardware.md has a minimal
// example.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "drivers/driver.h"

namespace stickslip::drivers {

/// Reading of an input.
struct Reading {
  double value = 0.0;         ///< in the unit of the input
  std::int64_t time_ns = 0;   ///< of the measurement, on the host's monotonic clock
  bool valid = false;         ///< false: the device marks it as invalid
  std::int64_t sigma_ns = 0;  ///< standard uncertainty of time_ns
};

/// An input that a gauge reads.
struct GaugeInput {
  std::string device;  ///< the DEVICE of DEVICE/INPUT in the configuration
  std::string name;    ///< the INPUT of DEVICE/INPUT
  std::string unit;    ///< "V/V", "mm"
};

/// Readings lost without an error of the gauge, since it was opened.
struct GaugeLosses {
  std::uint64_t missing = 0;   ///< expected readings that did not arrive
  std::uint64_t rejected = 0;  ///< replies with a wrong checksum, length or echo
};

/// Lifecycle: open -> read* -> close, in one thread. signals, and the constant name and inputs, may
/// be read in any.
class Gauge {
 public:
  Gauge() = default;
  Gauge(const Gauge&) = delete;
  Gauge& operator=(const Gauge&) = delete;
  virtual ~Gauge() = default;

  /// For display: "PhidgetBridge 1046 #123456".
  virtual const std::string& name() const = 0;
  virtual std::span<const GaugeInput> inputs() const = 0;

  /// Finds and configures the device. May take seconds.
  virtual Result open() = 0;

  /// Waits for the next reading, at most a fifth of a second. `readings` has one element per input,
  /// in their order; those without a new reading are left unchanged.
  ///   ok               at least one is new
  ///   no_data          nothing arrived
  ///   temporary        nothing valid arrived; the next read may succeed
  ///   needs_attention  an operator must act; the caller closes it and retries open with a delay
  ///   lost             disconnected; the caller does the same
  ///   fatal            it cannot be used again
  virtual Result read(std::span<Reading> readings) = 0;

  virtual void close() noexcept = 0;

  virtual GaugeLosses losses() const { return {}; }

  /// Of an open gauge: a deviation from its settings that the operator should know; empty: none.
  /// Only for the thread that calls the others.
  virtual std::string remark() const { return {}; }

  /// Of an amplifier that reports its state over its bus. Any thread; as cheap as reading a
  /// variable.
  virtual Signals signals() const noexcept { return {}; }
};

}  // namespace stickslip::drivers
