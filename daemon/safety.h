// SPDX-License-Identifier: Apache-2.0
// Permission of the amplifier to be on. Off is the default; a fault latches with its cause and is
// cleared only by an operator's command. Decided by the loop once a cycle, by no other thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "drivers/driver.h"

namespace stickslip::daemon {

/// Every daemon starts `faulted`: the rig has not been inspected yet.
enum class RigState : std::uint8_t {
  faulted,   ///< amplifier off, latched
  idle,      ///< amplifier off
  armed,     ///< amplifier off, every interlock holds, a start is allowed
  running,   ///< excitation on
  stopping,  ///< ramping down
};
inline constexpr std::size_t state_count = 5;

const char* name_of(RigState state);

enum class RigInput : std::uint8_t {
  clear,    ///< an operator has inspected the fault, and no interlock is broken
  arm,      ///< an operator prepares a start, and every interlock holds
  disarm,   ///< an operator withdraws that
  start,    ///< an operator starts the excitation
  stop,     ///< an operator, or the end of the duration, stops it
  at_rest,  ///< the drive has ramped down to zero
  fault,    ///< an interlock broke
};
inline constexpr std::size_t input_count = 7;

/// The state machine. Inputs that do not apply to a state leave it unchanged.
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

/// Reasons why the amplifier may not be on.
enum class Interlock : std::uint8_t {
  none,
  just_started,       ///< not cleared since the start of the daemon
  emergency_stop,     ///< pressed, wire cut, or unknown
  amplifier_fault,    ///< the amplifier's own protection
  device_lost,        ///< disconnected, or unusable
  device_silent,      ///< no frame, or no write accepted, for too long
  output_differs,     ///< the drive or the enable contact does not read back as commanded
  part_lost,          ///< an auxiliary device is lost: a bridge, an LVDT
  stale_channel,      ///< a channel has not been measured for too long
  overrun,            ///< a cycle was too late
  not_finite,         ///< a reading is not finite
  out_of_range,       ///< a channel, strain gauges included, is beyond its limit
  drive_not_finite,   ///< the excitation is not finite
  observer_diverged,  ///< if configured
  recorder_failing,   ///< if configured
  client_gone,        ///< the client that holds the dead-man's handle does not respond
};
inline constexpr std::size_t interlock_count = 16;

/// Identifier for programs: "emergency_stop".
const char* name_of(Interlock interlock);

/// True for interlocks that latch in every state. The others latch while the rig is armed or moves,
/// and otherwise prevent arming: a gauge out of range during a calibration with weights is no
/// fault.
constexpr bool latches_at_rest(Interlock interlock) {
  switch (interlock) {
    case Interlock::just_started:
    case Interlock::emergency_stop:
    case Interlock::amplifier_fault:
    case Interlock::device_lost:
    case Interlock::device_silent:
    case Interlock::output_differs:
      return true;
    default:
      return false;
  }
}

/// Text of fixed capacity: written in the real-time thread without allocation.
class Cause {
 public:
  Cause() = default;
  explicit Cause(std::string_view text) { add(text); }
  /// Truncated at 199 bytes in total.
  Cause& add(std::string_view text) {
    size_ += text.copy(text_.data() + size_, text_.size() - 1 - size_);
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

/// The state, with the cause of the latest fault. Does not allocate.
class Safety {
 public:
  /// True if the state changed. The caller refuses `clear` and `arm` while an interlock is broken.
  bool apply(RigInput input);

  /// A broken interlock. Latches if it does so in this state; the first cause stays until it is
  /// cleared. True if it latched.
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
  Cause cause_{"the daemon has just started; inspect the rig, then clear"};
  drivers::Outcome outcome_ = drivers::Outcome::ok;
};

}  // namespace stickslip::daemon
