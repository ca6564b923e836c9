// SPDX-License-Identifier: Apache-2.0
// Commands to the loop and its answers. Plain values of fixed size, which pass through rings.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

#include "daemon/calibration.h"
#include "daemon/interlocks.h"
#include "daemon/observer_types.h"
#include "daemon/safety.h"
#include "daemon/setting.h"
#include "physics/frame.h"

namespace stickslip::daemon {

class Excitation;

/// Settings that can change while the loop runs, always together.
struct LiveSettings {
  Calibration calibration{};
  InterlockSettings interlocks;
};

struct Command {
  enum class Kind : std::uint8_t {
    clear,
    arm,
    disarm,
    start,
    stop,
    set,      ///< `setting` of the excitation
    apply,    ///< `live` from the next frame on
    average,  ///< raw readings of the next `frames` frames; answered when they are complete
    drive,    ///< by `excitation`, which is swapped with the present one, of a rig at rest
    observe,  ///< by `observer`, which goes on from the present one, from the next frame on
  };
  Kind kind = Kind::stop;
  std::uint64_t id = 0;   ///< returned in the answer
  bool dead_man = false;  ///< start: only while Loop::keep_alive is called often enough
  std::uint64_t frames = 0;
  Setting setting;
  LiveSettings live;
  Observer* observer = nullptr;      ///< lent to the loop until its answer
  Excitation* excitation = nullptr;  ///< likewise
};
static_assert(std::is_trivially_copyable_v<Command>);

/// Mean and standard deviation of raw readings, by channel.
struct Average {
  std::uint64_t frames = 0;
  std::array<std::uint64_t, channel_count> count{};  ///< frames in which the channel was valid
  std::array<double, channel_count> mean{};          ///< raw; 0 if there were none
  std::array<double, channel_count> deviation{};     ///< of a single reading; 0 for fewer than two
  /// Effective number of independent readings: less than `count` if a filter or mains hum
  /// correlates neighbouring readings; from the variance of the means of sixteen batches.
  std::array<double, channel_count> independent{};
};

struct Answer {
  std::uint64_t id = 0;
  bool accepted = false;
  RigState state = RigState::faulted;  ///< after the command
  Cause reason;                        ///< of a refusal
  Average average;
  Continuation continuation;   ///< of the new observer
  std::int64_t time_ns = 0;    ///< of the latest frame before the command; of drive, observe
  std::uint64_t sequence = 0;  ///< of that frame
};
static_assert(std::is_trivially_copyable_v<Answer>);

/// Running sums of an Average by Welford's recurrence: offsets of a bridge are large compared with
/// its noise. Does not store the readings.
class Averaging {
 public:
  void begin(std::uint64_t frames, std::uint64_t id);
  bool active() const { return wanted_ > 0; }
  /// True if this was the last frame.
  bool add(const Frame& raw);
  std::uint64_t id() const { return id_; }
  /// The average so far; ends the averaging.
  Average take();

 private:
  static constexpr std::uint64_t batches = 16;
  struct Moments {
    double mean = 0.0;
    double squares = 0.0;  // sum of squared deviations
    std::uint64_t count = 0;
    void add(double value);
    double variance() const;
  };
  void close_batch();

  std::uint64_t wanted_ = 0;
  std::uint64_t id_ = 0;
  std::uint64_t frames_ = 0;
  std::array<Moments, channel_count> all_{};
  std::array<Moments, channel_count> batch_{};
  std::array<Moments, channel_count> batch_means_{};
};

}  // namespace stickslip::daemon
