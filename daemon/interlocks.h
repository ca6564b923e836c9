// SPDX-License-Identifier: Apache-2.0
// Conditions for the amplifier to be on, checked in every cycle. An interlock is broken as long as
// its condition is violated, if only for a cycle; Safety decides whether that latches.
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

/// Limits from the configuration. Times of 0: no limit.
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

/// Latest observation of each condition. All times on the loop's clock. Does not allocate.
class Interlocks {
 public:
  Interlocks() = default;
  /// `channels`: yielded by the device (bit i: Channel i).
  Interlocks(const InterlockSettings& settings, std::uint8_t channels);

  /// New limits; the observations stay.
  void set(const InterlockSettings& settings) { settings_ = settings; }

  /// Outcome of a call of the device. Lost, fatal and needs_attention break immediately, temporary
  /// failures and no_data only if they last too long.
  void read_result(const drivers::Result& result, std::int64_t now_ns) {
    update(result, now_ns, reads_);
  }
  void write_result(const drivers::Result& result, std::int64_t now_ns) {
    update(result, now_ns, writes_);
  }

  void signals(const drivers::Signals& signals) { signals_ = signals; }

  /// A calibrated frame, and its channels that were not finite (bit i: Channel i).
  void frame(const Frame& si, std::uint8_t not_finite, std::int64_t now_ns);

  /// Overrun of this cycle; 0 or less: none.
  void cycle_late(std::int64_t late_ns);

  void observer_restarted(bool in_this_cycle) { observer_restarted_ = in_this_cycle; }
  void recorder(bool failing) { recorder_failing_ = failing; }
  void drive(bool finite) { drive_finite_ = finite; }

  /// Time of the latest keep-alive from the holder of the dead-man's handle; nothing: not held.
  void dead_man(std::optional<std::int64_t> latest_ns) { dead_man_ns_ = latest_ns; }

  /// The device was restored or replaced: earlier observations of it no longer count.
  void device_restored();

  struct Broken {
    Interlock interlock = Interlock::none;
    Cause cause;
    drivers::Outcome outcome = drivers::Outcome::ok;
  };

  /// The most serious interlock that is broken at `now_ns`; `none` where all hold.
  Broken broken(std::int64_t now_ns) const;
  /// device_lost or device_silent, even if a more serious interlock is broken too; else `none`.
  Broken device_broken(std::int64_t now_ns) const;

 private:
  struct Silence {
    bool on = false;
    std::int64_t since_ns = 0;
    drivers::Outcome outcome = drivers::Outcome::ok;  // of a fault that does not wait
    Cause cause;
  };
  static void update(const drivers::Result& result, std::int64_t now_ns, Silence& silence);
  bool silence_broken(const Silence& silence, std::int64_t now_ns, Broken& out) const;
  bool output_broken(Broken& out) const;
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
