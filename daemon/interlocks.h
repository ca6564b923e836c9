// What has to hold for the amplifier to be on, looked at in every cycle. An interlock is broken for
// as long as what it watches is wrong, if only for a cycle; whether that latches is for Safety to
// decide.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "daemon/safety.h"
#include "drivers/driver.h"
#include "physics/frame.h"

namespace stickslip::daemon {

struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
};

/// What the rig's owner asks for. Times of 0: no limit.
struct InterlockSettings {
  std::int64_t longest_silence_ns = 100'000'000;  ///< of the device
  std::int64_t stale_after_ns = 0;                ///< without a measurement of a channel
  std::int64_t longest_overrun_ns = 0;
  std::int64_t dead_man_ns = 1'000'000'000;  ///< silence of the client that holds the handle
  bool not_finite = false;
  bool observer_diverged = false;
  bool recorder_failing = false;
  std::array<Range, channel_count> range{};  ///< SI
};

/// What was seen last of everything that is watched. All times on the loop's clock. Does not
/// allocate.
class Interlocks {
 public:
  Interlocks() = default;
  /// `channels`: those that the device yields (bit i: Channel i).
  Interlocks(const InterlockSettings& settings, std::uint8_t channels);

  /// New limits; what has been seen so far stays.
  void set(const InterlockSettings& settings) { settings_ = settings; }

  /// What the device answered. Lost, fatal and needs_attention break at once; temporary failures,
  /// and no data, when they have gone on for too long.
  void read_answered(const drivers::Result& result, std::int64_t now_ns) {
    answered(result, now_ns, reads_);
  }
  void write_answered(const drivers::Result& result, std::int64_t now_ns) {
    answered(result, now_ns, writes_);
  }

  void signals(const drivers::Signals& signals) { signals_ = signals; }

  /// A calibrated frame, and its channels that were no numbers (bit i: Channel i).
  void frame(const Frame& si, std::uint8_t not_finite, std::int64_t now_ns);

  /// How late a cycle came; 0 or less: in time.
  void cycle_late(std::int64_t late_ns);

  void observer_restarted(bool in_this_cycle) { observer_restarted_ = in_this_cycle; }
  void recorder(bool failing) { recorder_failing_ = failing; }
  void drive(bool finite) { drive_finite_ = finite; }

  /// The dead-man's handle: the time of the latest sign of life; nothing: nobody holds it.
  void dead_man(std::optional<std::int64_t> latest_ns) { dead_man_ns_ = latest_ns; }

  /// The device is a new one, or the same again after it was away: nothing is held against it.
  void device_is_back();

  struct Broken {
    Interlock interlock = Interlock::none;
    Cause cause;
    drivers::Outcome outcome = drivers::Outcome::ok;
  };

  /// The most serious interlock that is broken at `now_ns`; `none` where all hold.
  Broken broken(std::int64_t now_ns) const;
  /// device_lost or device_silent, whatever more serious is broken beside it; else `none`.
  Broken device_broken(std::int64_t now_ns) const;

 private:
  struct Silence {
    bool on = false;
    std::int64_t since_ns = 0;
    drivers::Outcome outcome = drivers::Outcome::ok;  // of a fault that does not wait
    Cause cause;
  };
  void answered(const drivers::Result& result, std::int64_t now_ns, Silence& silence);
  bool silence_broken(const Silence& silence, std::int64_t now_ns, Broken& out) const;
  bool channel_broken(std::int64_t now_ns, Broken& out) const;

  InterlockSettings settings_;
  std::uint8_t channels_ = 0;
  Silence reads_;
  Silence writes_;
  drivers::Signals signals_;
  std::uint8_t not_finite_ = 0;
  std::uint8_t out_of_range_ = 0;
  Frame latest_;
  std::array<std::int64_t, channel_count> measured_ns_{};
  bool any_frame_ = false;
  std::int64_t overrun_ns_ = 0;
  bool observer_restarted_ = false;
  bool recorder_failing_ = false;
  bool drive_finite_ = true;
  std::optional<std::int64_t> dead_man_ns_;
};

}  // namespace stickslip::daemon
