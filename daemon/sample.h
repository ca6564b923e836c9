// SPDX-License-Identifier: Apache-2.0
// The loop's output: a sample per cycle, estimates, and notices of what happened. Plain values of
// fixed size, which pass through rings without allocation.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "daemon/excitation.h"
#include "daemon/observer_types.h"
#include "daemon/safety.h"
#include "physics/frame.h"

namespace stickslip::daemon {

/// Data of one cycle.
struct Sample {
  std::uint64_t number = 0;  ///< of the loop's samples, from 0; independent of frame.sequence
  Frame frame;               ///< calibrated, SI
  Drive drive;               ///< applied while the frame was taken
  bool amplifier_on = false;
  bool late = false;  ///< its cycle was late by more than the limit
  RigState state = RigState::faulted;
};

static_assert(std::is_trivially_copyable_v<Sample>);

/// The observer's estimate after the sample of that number.
struct NumberedEstimate {
  std::uint64_t number = 0;
  Estimate estimate;
};

/// Something that the loop detected.
struct Notice {
  enum class Kind : std::uint8_t {
    fault,         ///< the amplifier is off; `text` is the cause
    state,         ///< change of state other than a fault; `text` is its name
    left_on,       ///< the last "off" was not acknowledged; `text`: by what, and what to do
    device_back,   ///< a lost device yields frames again
    clock_jumped,  ///< the source's clock was set, by `duration_ns`
    read_failed,   ///< first temporary failure in a row
    write_failed,
    frames_missing,  ///< the sequence number jumped by `count`
    sequence_repeated,
    not_finite,          ///< a channel (index `count`) became NaN or infinite
    beyond_calibration,  ///< a channel (index `count`) left its calibrated range
    overrun,             ///< by `duration_ns`; `count` periods were skipped
    end_of_data,
    estimate_restarted,  ///< the observer diverged and was restarted
  };
  Kind kind = Kind::fault;
  std::int64_t time_ns = 0;    ///< of the latest frame
  std::uint64_t sequence = 0;  ///< of the latest frame
  std::uint64_t count = 0;
  std::int64_t duration_ns = 0;
  std::array<char, 200> text{};  ///< zero-terminated

  /// Truncates `value` to the space there is.
  void set_text(std::string_view value) {
    const std::size_t length = value.copy(text.data(), text.size() - 1);
    text[length] = '\0';
  }
};

}  // namespace stickslip::daemon
