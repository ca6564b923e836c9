// What a device is to the daemon: two calls a cycle, read and write, and a lifecycle. Simulated and
// replayed rigs stand behind the same interface as hardware; the daemon cannot tell. A fault is a
// value that the interface returns, so that tests can inject any of them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "physics/frame.h"

namespace stickslip::drivers {

/// What became of a call.
enum class Outcome : std::uint8_t {
  ok,
  no_data,          ///< nothing to read yet; not a fault
  end_of_data,      ///< the source is finished (replay); no frame will come any more
  temporary,        ///< failed this time, may work the next (time-out, checksum)
  needs_attention,  ///< a person must do something (permission, wrong wiring, wrong device)
  lost,             ///< the device is gone (unplugged)
  fatal,            ///< this driver object cannot go on
};

/// An outcome and, unless it is ok, no_data or end_of_data, a sentence for a person. The text is a
/// string literal or owned by the driver and valid until its next call, so that returning a fault
/// never allocates.
struct Result {
  Outcome outcome = Outcome::ok;
  const char* message = "";

  explicit operator bool() const { return outcome == Outcome::ok; }
};

/// What the daemon asks of the shaker for the cycle to come.
struct Actuation {
  double drive = 0.0;  ///< commanded base displacement [m], or force [N] on force-excited rigs
  bool amplifier_on = false;  ///< off is the safe state
};

/// Lines that stand beside the channels, as they were when the latest frame was read.
struct Signals {
  bool emergency_stop = false;   ///< pressed, its wire is cut, or nobody can say
  bool amplifier_fault = false;  ///< the amplifier's own protection has tripped
  /// A device beside the one that yields the frames is not there: a sentence for a person, which
  /// lives as long as the driver. Null: all are there.
  const char* lost_part = nullptr;
};

/// How often something befell a device, or a level that it tells, for an operator's eyes.
struct Count {
  enum class Kind : std::uint8_t {
    sum,   ///< only grows, for as long as the driver lives
    level  ///< may fall again
  };
  const char* device = "";  ///< for a person; lives as long as the driver, and does not change
  const char* name = "";    ///< a literal, words joined by underscores: "scans_lost"
  std::uint64_t value = 0;
  Kind kind = Kind::sum;
};

/// The counts of all devices behind a driver. Of fixed room, so that telling them never allocates;
/// what finds no room is left out.
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

/// A paced driver's read waits at most so long for the next sample.
inline constexpr std::int64_t longest_paced_wait_ns = 20'000'000;

/// What a driver can say about itself once it is open.
struct Description {
  std::string name;                               ///< "simulated rig", "LabJack U6 #3600..."
  std::uint8_t channels = 0;                      ///< bit i: yields Channel i
  std::array<const char*, channel_count> unit{};  ///< raw unit by channel, before calibration
  bool paced = false;  ///< read() waits for the next sample itself (a streaming board, a replay)
  bool can_drive = false;  ///< write() moves something
  /// Time passes from frame to frame and stands still in between (a rig of equations), whatever the
  /// host's clock does.
  bool time_of_its_own = false;
  /// time_ns counts a crystal of the device's own, to be brought onto the host's clock.
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
  /// The next sample, in the driver's own units, with its device time, sequence number, validity
  /// bits and ages. `frame` is untouched unless the outcome is ok.
  virtual Result read(Frame& frame) = 0;
  virtual Result write(const Actuation& actuation) = 0;
  virtual void stop() noexcept = 0;
  virtual void close() noexcept = 0;

  virtual const Description& description() const = 0;

  /// Devices without such lines have none pressed. As cheap as reading a variable.
  virtual Signals signals() const noexcept { return {}; }

  /// After a stop: what may still be on because the last "off" was not confirmed, with the device's
  /// name and what to do, in a sentence; null where all is off. Stays until the next open that
  /// succeeds; lives as long as that. Only for the thread that may call stop.
  virtual const char* left_on() const noexcept { return nullptr; }

  /// Any thread, in every state, also while another one opens or closes. Does not wait.
  virtual Counts counts() const noexcept { return {}; }
};

}  // namespace stickslip::drivers
