// Whether the amplifier may be on. Off is the default and the answer to every doubt; a fault
// latches and names its cause, and only a person's command clears it. The loop asks once a cycle,
// and no other thread has a say in "off".
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "drivers/driver.h"

namespace stickslip::daemon {

/// `faulted` is where every daemon begins: nobody has looked at the rig yet.
enum class RigState : std::uint8_t {
  faulted,   ///< amplifier off, latched
  idle,      ///< amplifier off, nothing is asked of the shaker
  armed,     ///< amplifier off, every interlock holds, a start is allowed
  running,   ///< excitation on
  stopping,  ///< ramping down
};
inline constexpr std::size_t state_count = 5;

/// In words, for status and logs.
const char* name_of(RigState state);

/// What can happen to a rig, as far as its state is concerned.
enum class RigInput : std::uint8_t {
  clear,    ///< a person has looked at the fault, and its cause is gone
  arm,      ///< a person wants to start soon, and every interlock holds
  disarm,   ///< a person gave that up
  start,    ///< a person lets it move
  stop,     ///< a person, or the end of the time asked for, lets it come to rest
  at_rest,  ///< the drive has come down to zero
  fault,    ///< an interlock broke
};
inline constexpr std::size_t input_count = 7;

/// The whole machine. What a state has no use for leaves it as it is.
constexpr RigState next_state(RigState state, RigInput input) {
  if (input == RigInput::fault) return RigState::faulted;
  switch (state) {
    case RigState::faulted:
      return input == RigInput::clear ? RigState::idle : state;
    case RigState::idle:
      return input == RigInput::arm ? RigState::armed : state;
    case RigState::armed:
      if (input == RigInput::start) return RigState::running;
      return input == RigInput::disarm || input == RigInput::stop ? RigState::idle : state;
    case RigState::running:
      return input == RigInput::stop || input == RigInput::disarm ? RigState::stopping : state;
    case RigState::stopping:
      return input == RigInput::at_rest ? RigState::idle : state;
  }
  return RigState::faulted;
}

constexpr bool amplifier_allowed(RigState state) {
  return state == RigState::running || state == RigState::stopping;
}

/// Why the amplifier may not be on.
enum class Interlock : std::uint8_t {
  none,
  just_started,       ///< nobody has looked at the rig since the daemon began
  emergency_stop,     ///< pressed, its wire is cut, or nobody can say
  amplifier_fault,    ///< the amplifier's own protection
  device_lost,        ///< gone, or not to be used as it is
  device_silent,      ///< no frame, or no write taken, for too long
  part_lost,          ///< a device beside the board is gone: a bridge, an LVDT
  stale_channel,      ///< a channel has not been measured for too long
  overrun,            ///< a cycle came too late
  not_finite,         ///< a channel is no number
  out_of_range,       ///< a channel, strain gauges among them, is beyond its limit
  drive_not_finite,   ///< the excitation is no number
  observer_diverged,  ///< where the configuration says that this matters
  recorder_failing,   ///< where the configuration says that this matters
  client_gone,        ///< the client that holds the dead-man's handle is silent
};
inline constexpr std::size_t interlock_count = 15;

/// One word that programs can look for: "emergency_stop".
const char* name_of(Interlock interlock);

/// Interlocks that latch whatever the state is. The others latch while the rig is armed or moves,
/// and before that keep it from being armed: a gauge that is out of range while somebody hangs
/// weights on it is no fault.
constexpr bool latches_at_rest(Interlock interlock) {
  switch (interlock) {
    case Interlock::just_started:
    case Interlock::emergency_stop:
    case Interlock::amplifier_fault:
    case Interlock::device_lost:
    case Interlock::device_silent:
      return true;
    default:
      return false;
  }
}

/// Words of fixed room: a cause is written on the hot path and must not ask for memory.
class Cause {
 public:
  Cause() = default;
  /// The first 199 bytes of `words`.
  explicit Cause(std::string_view words) { add(words); }
  Cause& add(std::string_view words) {
    size_ += words.copy(text_.data() + size_, text_.size() - 1 - size_);
    text_[size_] = '\0';
    return *this;
  }
  /// Six significant digits.
  Cause& add(double value);
  const char* c_str() const { return text_.data(); }
  bool empty() const { return size_ == 0; }

 private:
  std::array<char, 200> text_{};
  std::size_t size_ = 0;
};

/// The state with the cause of its latest fault. Does not allocate.
class Safety {
 public:
  /// Applies the input. `clear` and `arm` are for the caller to refuse while an interlock is
  /// broken. Whether the state changed.
  bool apply(RigInput input);

  /// An interlock that is broken now. Latches, if it does so in this state; the first cause stays
  /// until it is cleared. Whether it latched.
  bool trip(Interlock interlock, const Cause& cause,
            drivers::Outcome outcome = drivers::Outcome::ok);

  RigState state() const { return state_; }
  bool faulted() const { return state_ == RigState::faulted; }
  bool amplifier_allowed() const { return daemon::amplifier_allowed(state_); }
  /// Of the latest fault; `none` and empty once it is cleared.
  Interlock interlock() const { return interlock_; }
  const Cause& cause() const { return cause_; }
  drivers::Outcome outcome() const { return outcome_; }

 private:
  RigState state_ = RigState::faulted;
  Interlock interlock_ = Interlock::just_started;
  Cause cause_{"the daemon has just started; nobody has looked at the rig yet"};
  drivers::Outcome outcome_ = drivers::Outcome::ok;
};

}  // namespace stickslip::daemon
