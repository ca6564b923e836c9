// What the loop hands to its consumers every cycle, and what it says when something happens. Both
// are plain values of fixed size: they travel through rings without allocation.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "daemon/estimate.h"
#include "daemon/excitation.h"
#include "daemon/safety.h"
#include "physics/frame.h"

namespace stickslip::daemon {

/// One cycle's worth of data.
struct Sample {
  std::uint64_t number =
      0;        ///< counts the loop's samples from 0, whatever the source's sequence does
  Frame frame;  ///< calibrated, SI
  Drive drive;  ///< what the shaker was asked for while the frame was taken
  bool amplifier_on = false;
  bool late = false;  ///< taken by a cycle that came later than its limit
  RigState state = RigState::faulted;
};

static_assert(std::is_trivially_copyable_v<Sample>);

/// What the observer believed after the sample of that number.
struct NumberedEstimate {
  std::uint64_t number = 0;
  Estimate estimate;
};

/// Something that the loop noticed.
struct Notice {
  enum class Kind : std::uint8_t {
    fault,         ///< the amplifier is off; `text` is the cause
    state,         ///< the state is now another, without a fault; `text` is its name
    left_on,       ///< the last "off" was not confirmed; `text` says of what, and what to do
    device_back,   ///< a device that was lost yields frames again
    clock_parted,  ///< device and host no longer agree on time; the correction begins anew
    read_failed,   ///< first temporary failure in a row
    write_failed,
    frames_missing,  ///< the sequence number jumped by `count`
    sequence_repeated,
    not_finite,          ///< a channel (`count`: its index) became NaN or infinite
    beyond_calibration,  ///< a channel (`count`) left the range in which it was calibrated
    overrun,             ///< by `duration_ns`; `count` periods were skipped
    end_of_data,
    estimate_restarted,  ///< the observer diverged and began anew
    model_broken,        ///< the rig no longer follows its model; `verdict` says in what
    model_follows,       ///< it follows again
  };
  Kind kind = Kind::fault;
  std::int64_t time_ns = 0;    ///< of the latest frame
  std::uint64_t sequence = 0;  ///< of the latest frame
  std::uint64_t count = 0;
  std::int64_t duration_ns = 0;
  std::array<char, 200> text{};  ///< zero-terminated
  ModelVerdict verdict;          ///< of a model_broken

  /// Copies as much of `words` as fits.
  void set_text(std::string_view words) {
    const std::size_t length = words.copy(text.data(), text.size() - 1);
    text[length] = '\0';
  }
};

}  // namespace stickslip::daemon
