// SPDX-License-Identifier: Apache-2.0
// The configured signal as if it had always run: without start and stop, gain and limits. Pure: no
// clock; the caller supplies the time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "config/rig.h"
#include "daemon/drive_file.h"
#include "daemon/setting.h"

namespace stickslip::daemon {

/// A parameter that changes while the rig runs: approaches its target at a limited rate, which it
/// reaches and leaves within a quarter of a second, without jump or overshoot.
class SlewLimiter {
 public:
  SlewLimiter(double value, double slew_per_s)
      : value_(value), target_(value), slew_per_s_(slew_per_s) {}
  void set(double target) { target_ = target; }
  /// With `may_rise` false the value does not increase.
  void advance(double duration_s, bool may_rise = true);
  double value() const { return value_; }
  double target() const { return target_; }

 private:
  double value_;
  double target_;
  double slew_per_s_;
  double rate_per_s_ = 0.0;
};

/// All kinds of docs/excitation.md. Does not allocate after construction.
class Waveform {
 public:
  /// `amplitude_slew` [m/s] or [N/s]. `file` is used by the kind `file` only.
  Waveform(const config::Excitation& settings, double amplitude_slew, DriveFile file);

  /// Starts from the beginning, for the kinds that have one.
  void restart();

  /// Ignored if the kind lacks that parameter or the value is invalid.
  void set(const Setting& setting);

  /// Advances time; does not allocate.
  void advance(double duration_s);

  double value() const { return value_; }            ///< [m] or [N]
  double amplitude() const { return amplitude_; }    ///< of the carrier, or of the sum of lines
  double carrier_hz() const { return carrier_hz_; }  ///< 0 without a carrier
  /// carrier_hz() of the next step; 0 if it is not a parameter of the kind.
  double idle_carrier_hz() const;
  double phase_turns() const { return phase_turns_; }            ///< of the carrier, [0, 1)
  double modulation_turns() const { return modulation_turns_; }  ///< of the slow part, [0, 1)
  bool over() const { return over_; }  ///< end of a file that does not repeat

 private:
  void advance_carrier(double hz, double duration_s);
  void modulate(double duration_s);
  void modulate_by_hand(double duration_s);
  void sweep(double duration_s);
  void burst(double duration_s);
  void sum_lines(double duration_s);
  void play(double duration_s);
  void next_movement();

  config::Excitation settings_;
  DriveFile file_;
  std::vector<config::Line> lines_;  // of unit amplitude if the amplitude is a parameter
  std::vector<double> line_turns_;
  double lines_amplitude_ = 0.0;
  SlewLimiter level_;
  SlewLimiter carrier_;
  SlewLimiter modulation_hz_;
  SlewLimiter modulation_depth_;
  double length_s_ = 0.0;  // of a repetition: envelope, sweep, burst and pause, file
  double time_s_ = 0.0;    // in the repetition
  double value_ = 0.0;
  double amplitude_ = 0.0;
  double carrier_hz_ = 0.0;
  double phase_turns_ = 0.0;
  double modulation_turns_ = 0.0;
  bool over_ = false;

  // Hand position: 0 at by_hand.lowest, 1 at the amplitude.
  std::uint64_t random_ = 0;
  double hand_from_ = 0.0;
  double hand_to_ = 0.0;
  double hand_time_s_ = 0.0;
  double hand_duration_s_ = 0.0;
};

}  // namespace stickslip::daemon
