#include "daemon/safety.h"

#include <string_view>

namespace stickslip::daemon {

const char* name_of(RigState state) {
  switch (state) {
    case RigState::idle:
      return "idle";
    case RigState::running:
      return "running";
    case RigState::stopping:
      return "stopping";
    case RigState::stopped:
      return "idle";
    case RigState::faulted:
      return "faulted";
  }
  return "unknown";
}

void Safety::start() {
  if (state_ == RigState::idle || state_ == RigState::stopped) state_ = RigState::running;
}

void Safety::begin_stop() {
  if (state_ == RigState::running) state_ = RigState::stopping;
}

void Safety::finish_stop() {
  if (state_ != RigState::faulted) state_ = RigState::stopped;
}

void Safety::observe(const drivers::Result& result, std::int64_t now_ns, Silence& silence) {
  using drivers::Outcome;
  switch (result.outcome) {
    case Outcome::ok:
    case Outcome::end_of_data:
      silence.on = false;
      return;
    case Outcome::no_data:
      if (too_long(now_ns, silence)) trip(Outcome::lost, "the device yields no data any more");
      return;
    case Outcome::temporary:
      if (too_long(now_ns, silence)) trip(Outcome::lost, result.message);
      return;
    case Outcome::needs_attention:
    case Outcome::lost:
    case Outcome::fatal:
      trip(result.outcome, result.message);
      return;
  }
}

bool Safety::too_long(std::int64_t now_ns, Silence& silence) const {
  if (!silence.on) silence = {true, now_ns};
  return longest_silence_ns_ > 0 && now_ns - silence.since_ns >= longest_silence_ns_;
}

void Safety::trip(drivers::Outcome outcome, const char* cause) {
  if (state_ == RigState::faulted) return;
  state_ = RigState::faulted;
  fault_outcome_ = outcome;
  const std::string_view words(cause);
  fault_cause_[words.copy(fault_cause_.data(), fault_cause_.size() - 1)] = '\0';
}

}  // namespace stickslip::daemon
