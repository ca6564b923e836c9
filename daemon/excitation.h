// SPDX-License-Identifier: Apache-2.0
// The drive of the shaker, cycle by cycle: the configured waveform, ramped, times the gain of the
// amplitude control, through the limits. Pure: no clock, no device; the caller supplies the time.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "config/rig.h"
#include "daemon/amplitude_control.h"
#include "daemon/base_limits.h"
#include "daemon/setting.h"
#include "daemon/waveform.h"
#include "physics/frame.h"

namespace stickslip::daemon {

/// The signal at one instant.
struct Drive {
  double value = 0.0;             ///< sent to the device: [m] of base displacement, or [N]
  double amplitude = 0.0;         ///< commanded, of the carrier, ramp included; same unit
  double carrier_hz = 0.0;        ///< present; 0 without a carrier
  double phase_turns = 0.0;       ///< of the carrier, [0, 1)
  double modulation_turns = 0.0;  ///< of the modulation, the envelope, the sweep, the file; [0, 1)
  double gain = 1.0;              ///< of the amplitude control; part of `value`
  Limit limited = Limit::none;    ///< why `value` differs from the command

  friend bool operator==(const Drive&, const Drive&) = default;
};

/// Properties of the rig that an excitation drives.
struct DrivenRig {
  MotionLimits limits{};
  Channel channel = Channel::base_displacement;  ///< or drive_force: driven and measured
  double period_s = 1e-3;                        ///< of the loop
};

DrivenRig driven_rig(const config::Rig& rig);

/// Phase, ramp and limits are continuous from step to step: changes of frequency, starts and stops
/// never jump. Does not allocate after construction.
class Excitation {
 public:
  /// Without limits: for rigs without a drive, and for tests.
  explicit Excitation(const config::Excitation& settings) : Excitation(settings, DrivenRig{}) {}

  /// Throws InputError for a drive file that is invalid or exceeds the limits.
  Excitation(const config::Excitation& settings, const DrivenRig& rig);

  /// Plays `file` in place of the one that the settings name, whose kind is `file`. Throws
  /// InputError, with `name` for the file, where it exceeds the limits.
  Excitation(const config::Excitation& settings, const DrivenRig& rig, DriveFile file,
             const std::string& name);

  /// Ramps up: a carrier from its current phase, a sweep, a burst or a file from its beginning. No
  /// effect if the configuration disables the excitation.
  void start();

  /// Ramps down to zero within ramp_s; the state becomes `off` once the limits have let it come to
  /// rest.
  void stop();

  /// Zero immediately: after a fault the amplifier is off anyway.
  void cut();

  /// Changes a parameter: carrier and amplitude approach their new values at a limited rate, the
  /// one that reduces the motion first, with continuous phase. The caller checks the setting with
  /// `refusal`; here an invalid value is ignored, and the limits hold in any case.
  void set(const Setting& setting) { waveform_.set(setting); }

  /// The calibrated frame taken while now() was applied, for the amplitude control. Once a frame,
  /// before `advance`; no effect without amplitude control.
  void observe(const Frame& frame, bool amplifier_on);

  /// Advances time by `duration_s`, with one step of the limits, and returns the drive. No effect
  /// for a duration of 0.
  Drive advance(double duration_s);

  enum class State : std::uint8_t { off, rising, steady, falling };

  const Drive& now() const { return now_; }
  State state() const { return state_; }
  bool is_off() const { return state_ == State::off; }
  /// True if the configuration enables the excitation.
  bool enabled() const { return enabled_; }
  const BaseLimits& limits() const { return limits_; }
  /// Null without amplitude control.
  const AmplitudeControl* control() const { return control_ ? &*control_ : nullptr; }

 private:
  struct Unchecked {};
  Excitation(const config::Excitation& settings, const DrivenRig& rig, Unchecked, DriveFile file);
  double ramp_step(double duration_s);
  void rest();

  bool enabled_;
  double ramp_s_;
  Channel channel_;
  Waveform waveform_;
  std::optional<AmplitudeControl> control_;
  BaseLimits limits_;
  State state_ = State::off;
  double ramp_ = 0.0;  // 0 to 1, linear in time; applied through a smooth step
  Drive now_;
};

}  // namespace stickslip::daemon
