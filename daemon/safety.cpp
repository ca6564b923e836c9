// SPDX-License-Identifier: Apache-2.0
#include "daemon/safety.h"

#include <charconv>

namespace stickslip::daemon {

const char* name_of(RigState state) {
  switch (state) {
    case RigState::faulted:
      return "faulted";
    case RigState::idle:
      return "idle";
    case RigState::armed:
      return "armed";
    case RigState::running:
      return "running";
    case RigState::stopping:
      return "stopping";
  }
  return "unknown";
}

const char* name_of(Interlock interlock) {
  constexpr std::array<const char*, interlock_count> names = {"none",
                                                              "just_started",
                                                              "emergency_stop",
                                                              "amplifier_fault",
                                                              "device_lost",
                                                              "device_silent",
                                                              "output_differs",
                                                              "part_lost",
                                                              "stale_channel",
                                                              "overrun",
                                                              "not_finite",
                                                              "out_of_range",
                                                              "drive_not_finite",
                                                              "observer_diverged",
                                                              "recorder_failing",
                                                              "client_gone"};
  return names.at(static_cast<std::size_t>(interlock));
}

Cause& Cause::add(double value) {
  std::array<char, 32> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value,
                                 std::chars_format::general, 6);
  return add(std::string_view(digits.data(), static_cast<std::size_t>(end.ptr - digits.data())));
}

bool Safety::apply(RigInput input) {
  const RigState before = state_;
  state_ = next_state(state_, input);
  if (before == RigState::faulted && state_ != before) {
    interlock_ = Interlock::none;
    cause_ = Cause();
    outcome_ = drivers::Outcome::ok;
  }
  return state_ != before;
}

bool Safety::trip(Interlock interlock, const Cause& cause, drivers::Outcome outcome) {
  if (state_ == RigState::faulted) return false;
  if (state_ == RigState::idle && !latches_at_rest(interlock)) return false;
  state_ = next_state(state_, RigInput::fault);
  interlock_ = interlock;
  cause_ = cause;
  outcome_ = outcome;
  return true;
}

}  // namespace stickslip::daemon
