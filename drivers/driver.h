// SPDX-License-Identifier: Apache-2.0
// Interface of a device: two calls per cycle, read and write, and a lifecycle. Simulated and
// replayed rigs implement the same interface as hardware; the daemon cannot distinguish them. A
// fault is a value that the interface returns, so that tests can inject any fault.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "physics/frame.h"

namespace stickslip::drivers {

/// Outcome of a call.
enum class Outcome : std::uint8_t {
  ok,
  no_data,          ///< nothing to read yet; not a fault
  end_of_data,      ///< the source is exhausted (replay)
  temporary,        ///< failed, may succeed next time (time-out, checksum)
  needs_attention,  ///< an operator must act (permission, wiring, wrong device)
  lost,             ///< the device is disconnected
  fatal,            ///< this driver object cannot continue
};

/// An outcome and, unless it is ok, no_data or end_of_data, a message for the operator. The message
/// is a string literal, or owned by the driver and valid until its next call, so that returning a
/// fault never allocates.
struct Result {
  Outcome outcome = Outcome::ok;
  const char* message = "";

  explicit operator bool() const { return outcome == Outcome::ok; }
};

/// Command to the shaker for the next cycle.
struct Actuation {
  double drive = 0.0;  ///< commanded base displacement [m], or force [N] on force-excited rigs
  bool amplifier_on = false;  ///< off is the safe state
};

/// An output that differs from its command, by the input that reads it back.
struct DifferingOutput {
  const char* name = nullptr;  ///< "the drive", valid as long as the driver; null: none differs
  double reading = 0.0;        ///< in the unit below
  double low = 0.0;            ///< the commands, as they would read: from low
  double high = 0.0;           ///< to high
  const char* unit = "";       ///< a literal; null: the name says all, and the numbers are unknown
};

/// Inputs of a board that read its outputs back, as of the latest frame [V]. Empty: not configured,
/// or no frame yet.
struct OutputReadings {
  std::optional<double> drive_v;
  std::optional<double> enable_v;
};

/// Digital inputs, as of the latest frame.
struct Signals {
  bool emergency_stop = false;   ///< pressed, its wire is cut, or unknown
  bool amplifier_fault = false;  ///< the amplifier's own protection has tripped
  /// An output does not read back as it was commanded.
  DifferingOutput differing_output{};
  /// A secondary device (one that does not yield the frames) is disconnected: a message for the
  /// operator, valid as long as the driver. Null: none is.
  const char* lost_device = nullptr;
};

/// An event counter of a device, or a level that it reports, for display.
struct Count {
  enum class Kind : std::uint8_t {
    sum,   ///< monotonic over the life of the driver
    level  ///< may decrease
  };
  const char* device = "";  ///< for display; constant, valid as long as the driver
  const char* name = "";    ///< a literal, words joined by underscores: "scans_lost"
  std::uint64_t value = 0;
  Kind kind = Kind::sum;
};

/// The counts of all devices of a driver. The capacity is fixed, so that no call allocates; excess
/// counts are dropped.
class Counts {
 public:
  void add(const Count& count) {
    if (size_ < all_.size()) all_[size_++] = count;
  }
  void add(std::span<const Count> counts) {
    for (const Count& count : counts) add(count);
  }
  std::span<const Count> all() const { return {all_.data(), size_}; }

 private:
  std::array<Count, 64> all_{};
  std::size_t size_ = 0;
};

/// Longest time that the read of a paced driver waits for the next sample.
inline constexpr std::int64_t longest_paced_wait_ns = 20'000'000;

/// Properties of a driver once it is open.
struct Description {
  std::string name;                               ///< "simulated rig", "LabJack U6 #3600..."
  std::uint8_t channels = 0;                      ///< bit i: provides Channel i
  std::array<const char*, channel_count> unit{};  ///< raw unit by channel, before calibration
  bool paced = false;      ///< read() waits for the next sample (a streaming board, a replay)
  bool can_drive = false;  ///< write() drives a shaker
  /// Time advances by frames only, independently of the host's clock (a simulated rig).
  bool stepped_time = false;
  /// A board of a bench: time_ns is that of its own crystal, which the bench maps to the host's
  /// clock.
  bool own_clock = false;
};

/// Lifecycle: open -> start -> (read, write)* -> stop -> close; stop and close are allowed in every
/// state and never throw. open, start, stop and close may take time and allocate; read and write
/// may not allocate, lock or wait longer than a cycle.
class Driver {
 public:
  Driver() = default;
  Driver(const Driver&) = delete;
  Driver& operator=(const Driver&) = delete;
  virtual ~Driver() = default;

  virtual Result open() = 0;
  virtual Result start() = 0;
  /// The next sample, in the driver's units, with device time, sequence number, validity bits and
  /// ages. `frame` is unchanged unless the outcome is ok.
  virtual Result read(Frame& frame) = 0;
  virtual Result write(const Actuation& actuation) = 0;
  virtual void stop() noexcept = 0;
  virtual void close() noexcept = 0;

  virtual const Description& description() const = 0;

  /// Inactive for devices without such lines. As cheap as reading a variable.
  virtual Signals signals() const noexcept { return {}; }

  /// Standard uncertainties of the ages in the latest frame, those of clocks and transmission [us];
  /// 0 where sampled with the frame, or unknown. Only for the thread that reads.
  virtual std::array<std::int32_t, channel_count> age_sigma_us() const noexcept { return {}; }

  /// Only for the thread that reads.
  virtual OutputReadings output_readings() const noexcept { return {}; }

  /// After a stop: a message that names the output that may still be on because the last "off" was
  /// not confirmed, and the action to take; null if everything is off. Valid until the next
  /// successful open. Only for the thread that may call stop.
  virtual const char* left_on() const noexcept { return nullptr; }

  /// Any thread, in every state, also during open and close in another thread. Does not wait.
  virtual Counts counts() const noexcept { return {}; }
};

}  // namespace stickslip::drivers
