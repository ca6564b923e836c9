// Whether the amplifier may be on. Off is the default and the answer to every doubt; a fault
// latches and names its cause. The daemon asks once a cycle and no other thread is needed for
// "off".
#pragma once

#include <array>
#include <cstdint>

#include "drivers/driver.h"

namespace stickslip::daemon {

enum class RigState : std::uint8_t {
  idle,      ///< nothing has been asked of the shaker
  running,   ///< excitation on, or acquiring with the shaker at rest
  stopping,  ///< ramping down
  stopped,   ///< at rest, amplifier off; "idle" to the outside
  faulted,   ///< amplifier off, latched
};

/// In words, for status and logs.
const char* name_of(RigState state);

/// A small machine: idle -> running -> stopping -> stopped, and faulted from anywhere. Does not
/// allocate.
class Safety {
 public:
  /// `longest_silence_ns`: for how long the device may fail temporarily, or yield nothing, before
  /// it counts as lost; 0: for ever (a replay may have gaps).
  explicit Safety(std::int64_t longest_silence_ns) : longest_silence_ns_(longest_silence_ns) {}

  void start();
  void begin_stop();
  void finish_stop();

  /// What the device answered to a read at `now_ns`. Lost, fatal and needs_attention trip at once;
  /// temporary failures, and no data, when they have gone on for too long.
  void observe_read(const drivers::Result& result, std::int64_t now_ns) {
    observe(result, now_ns, reads_);
  }

  /// The same for a write.
  void observe_write(const drivers::Result& result, std::int64_t now_ns) {
    observe(result, now_ns, writes_);
  }

  /// Latches a fault; the first one keeps its cause, of which the first 199 bytes are copied.
  void trip(drivers::Outcome outcome, const char* cause);

  bool amplifier_allowed() const {
    return state_ == RigState::running || state_ == RigState::stopping;
  }
  bool faulted() const { return state_ == RigState::faulted; }
  RigState state() const { return state_; }
  drivers::Outcome fault_outcome() const { return fault_outcome_; }
  const char* fault_cause() const { return fault_cause_.data(); }

 private:
  struct Silence {
    bool on = false;
    std::int64_t since_ns = 0;
  };
  void observe(const drivers::Result& result, std::int64_t now_ns, Silence& silence);
  bool too_long(std::int64_t now_ns, Silence& silence) const;

  std::int64_t longest_silence_ns_;
  Silence reads_;
  Silence writes_;
  RigState state_ = RigState::idle;
  drivers::Outcome fault_outcome_ = drivers::Outcome::ok;
  std::array<char, 200> fault_cause_{};
};

}  // namespace stickslip::daemon
