// What the shaker is told, cycle by cycle: the configured waveform, ramped, times the gain of the
// amplitude control, through the limits. Pure: no clock, no device; time is what the caller says
// has passed.
#pragma once

#include <cstdint>
#include <optional>

#include "config/rig.h"
#include "daemon/amplitude_control.h"
#include "daemon/base_limits.h"
#include "daemon/setting.h"
#include "daemon/waveform.h"
#include "physics/frame.h"

namespace stickslip::daemon {

/// The signal at one instant.
struct Drive {
  double value = 0.0;             ///< told to the device: [m] of base displacement, or [N]
  double amplitude = 0.0;         ///< of the carrier now as asked for, ramp included; same unit
  double carrier_hz = 0.0;        ///< now; 0 where there is no carrier
  double phase_turns = 0.0;       ///< of the carrier, [0, 1)
  double modulation_turns = 0.0;  ///< of the modulation, the envelope, the sweep, the file; [0, 1)
  double gain = 1.0;              ///< of the amplitude control, by which `value` holds more or less
  Limit limited = Limit::none;    ///< why `value` is not what was asked for

  friend bool operator==(const Drive&, const Drive&) = default;
};

/// The rig that an excitation drives, as far as it has to know it.
struct DrivenRig {
  MotionLimits limits{};
  Channel channel = Channel::base_displacement;  ///< or drive_force: what is driven, and measured
  double period_s = 1e-3;                        ///< of the loop
};

/// What holds for a rig's configuration.
DrivenRig driven_rig(const config::Rig& rig);

/// Phase, ramp and limits are carried from step to step, so that a change of frequency, a start and
/// a stop never jump. Does not allocate after construction.
class Excitation {
 public:
  /// Without limits: for rigs that cannot be driven, and for tests.
  explicit Excitation(const config::Excitation& settings) : Excitation(settings, DrivenRig{}) {}

  /// Throws InputError for a file that is no drive, or one beyond the limits.
  Excitation(const config::Excitation& settings, const DrivenRig& rig);

  /// Ramps up: a carrier from where it is, a sweep, a burst or a file from its beginning. No effect
  /// where the configuration has it disabled.
  void start();

  /// Ramps down to zero within ramp_s; then, as soon as the limits have let it come to rest there,
  /// the state is `off`.
  void stop();

  /// Zero at once: after a fault the amplifier is off anyway.
  void cut();

  /// Turns a knob: carrier and amplitude glide to their new values, what lessens the motion first,
  /// and the phase goes on. What `refusal` refuses is the caller's to hold back; here a value
  /// without sense is ignored, and the limits hold in any case.
  void set(const Setting& setting) { waveform_.set(setting); }

  /// The calibrated frame that was taken while now() was applied, for the amplitude control. Once a
  /// frame, before `advance`; no effect where the control is disabled.
  void observe(const Frame& frame, bool amplifier_on);

  /// Moves time on by `duration_s` and returns the drive there; one step of the limits. Without
  /// duration nothing moves.
  Drive advance(double duration_s);

  enum class State : std::uint8_t { off, rising, steady, falling };

  const Drive& now() const { return now_; }
  State state() const { return state_; }
  bool is_off() const { return state_ == State::off; }
  /// Whether the configuration has it drive at all.
  bool enabled() const { return enabled_; }
  const BaseLimits& limits() const { return limits_; }
  /// Null where it is disabled.
  const AmplitudeControl* control() const { return control_ ? &*control_ : nullptr; }

 private:
  double ramp_step(double duration_s);
  void rest();

  bool enabled_;
  double ramp_s_;
  Channel channel_;
  Waveform waveform_;
  std::optional<AmplitudeControl> control_;
  BaseLimits limits_;
  State state_ = State::off;
  double ramp_ = 0.0;  // 0 to 1, linear in time; what is applied is its smooth step
  Drive now_;
};

}  // namespace stickslip::daemon
