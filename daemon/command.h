// What a person asks of the loop, and what it answers. Plain values of fixed size: they travel
// through rings.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

#include "daemon/calibration.h"
#include "daemon/interlocks.h"
#include "daemon/safety.h"
#include "daemon/setting.h"
#include "physics/frame.h"

namespace stickslip::daemon {

/// What may change while the loop runs, all of it at once.
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
    average,  ///< raw readings of the next `frames` frames; answered when they are in
  };
  Kind kind = Kind::stop;
  std::uint64_t id = 0;   ///< comes back in the answer
  bool dead_man = false;  ///< start: only while Loop::touch is called often enough
  std::uint64_t frames = 0;
  Setting setting;
  LiveSettings live;
};
static_assert(std::is_trivially_copyable_v<Command>);

/// Mean and standard deviation of raw readings, by channel.
struct Average {
  std::uint64_t frames = 0;
  std::array<std::uint64_t, channel_count> count{};  ///< frames in which the channel was valid
  std::array<double, channel_count> mean{};          ///< raw; 0 where there were none
  std::array<double, channel_count> deviation{};     ///< of a single reading; 0 where under two
  /// How many independent readings would know the mean as well: fewer than `count` where a filter
  /// or a hum makes neighbours alike, as told by the scatter of the means of sixteen parts.
  std::array<double, channel_count> independent{};
};

struct Answer {
  std::uint64_t id = 0;
  bool accepted = false;
  RigState state = RigState::faulted;  ///< after the command
  Cause reason;                        ///< of a refusal
  Average average;
};
static_assert(std::is_trivially_copyable_v<Answer>);

/// Sums for an Average, without memory of the readings (Welford's recurrence: offsets of a bridge
/// are large against its noise).
class Averaging {
 public:
  void begin(std::uint64_t frames, std::uint64_t id);
  bool active() const { return wanted_ > 0; }
  /// Whether that was the last.
  bool add(const Frame& raw);
  std::uint64_t id() const { return id_; }
  /// What has been summed; ends it.
  Average take();

 private:
  static constexpr std::uint64_t parts = 16;
  struct Moments {
    double mean = 0.0;
    double squares = 0.0;  // sum of squared deviations
    std::uint64_t count = 0;
    void add(double value);
    double variance() const;
  };
  void close_part();

  std::uint64_t wanted_ = 0;
  std::uint64_t id_ = 0;
  std::uint64_t frames_ = 0;
  std::array<Moments, channel_count> all_{};
  std::array<Moments, channel_count> part_{};
  std::array<Moments, channel_count> part_means_{};
};

}  // namespace stickslip::daemon
