// The signal that the configuration describes, as if it had always run: without start and stop,
// gain and limits. Pure: no clock; time is what the caller says has passed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "config/rig.h"
#include "daemon/drive_file.h"
#include "daemon/setting.h"

namespace stickslip::daemon {

/// A number that is turned while the rig runs. It moves to its new value at most at a given rate,
/// gets to that rate and back within a quarter of a second, and neither jumps nor overshoots.
class Glide {
 public:
  Glide(double value, double slew_per_s) : value_(value), target_(value), slew_per_s_(slew_per_s) {}
  void set(double target) { target_ = target; }
  /// `may_rise` false: as if the value were not to become larger.
  void advance(double duration_s, bool may_rise = true);
  double value() const { return value_; }
  double target() const { return target_; }

 private:
  double value_;
  double target_;
  double slew_per_s_;
  double rate_per_s_ = 0.0;
};

/// Each kind of docs/excitation.md. Owns heap memory only from its construction on.
class Waveform {
 public:
  /// `amplitude_slew` [m/s] or [N/s]. `file` is used by the kind `file` only.
  Waveform(const config::Excitation& settings, double amplitude_slew, DriveFile file);

  /// The next value is that of the signal's beginning, for the kinds that have one.
  void restart();

  /// Ignored where the kind has no such knob, or the value makes no sense.
  void set(const Setting& setting);

  /// Moves time on; allocates nothing.
  void advance(double duration_s);

  double value() const { return value_; }            ///< [m] or [N]
  double amplitude() const { return amplitude_; }    ///< of the carrier, or the size of the sum
  double carrier_hz() const { return carrier_hz_; }  ///< 0 where there is none
  /// What carrier_hz() will be when time moves on; 0 where that is not a setting.
  double idle_carrier_hz() const;
  double phase_turns() const { return phase_turns_; }            ///< of the carrier, [0, 1)
  double modulation_turns() const { return modulation_turns_; }  ///< of what is slow, [0, 1)
  bool over() const { return over_; }  ///< a file that does not repeat has ended

 private:
  void advance_carrier(double hz, double duration_s);
  void modulate(double duration_s);
  void turn_by_hand(double duration_s);
  void sweep(double duration_s);
  void burst(double duration_s);
  void sum_lines(double duration_s);
  void play(double duration_s);
  void next_movement();

  config::Excitation settings_;
  DriveFile file_;
  std::vector<config::Line> lines_;  // of unit size where the amplitude can be turned
  std::vector<double> line_turns_;
  double size_of_lines_ = 0.0;
  Glide level_;
  Glide carrier_;
  Glide modulation_hz_;
  Glide modulation_depth_;
  double length_s_ = 0.0;  // of what is repeated: envelope, sweep, burst and pause, file
  double time_s_ = 0.0;    // in it
  double value_ = 0.0;
  double amplitude_ = 0.0;
  double carrier_hz_ = 0.0;
  double phase_turns_ = 0.0;
  double modulation_turns_ = 0.0;
  bool over_ = false;

  // The hand: from one position to the next, 0 at by_hand.lowest and 1 at the amplitude.
  std::uint64_t random_ = 0;
  double hand_from_ = 0.0;
  double hand_to_ = 0.0;
  double hand_time_s_ = 0.0;
  double hand_duration_s_ = 0.0;
};

}  // namespace stickslip::daemon
