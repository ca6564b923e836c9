// What the shaker is asked to do, cycle by cycle: config::Excitation as a signal. Pure: no clock,
// no device; time is what the caller says has passed.
#pragma once

#include <cstdint>

#include "config/rig.h"

namespace stickslip::daemon {

/// The signal at one instant.
struct Drive {
  double value = 0.0;             ///< [m] of base displacement, or [N] on force-excited rigs
  double amplitude = 0.0;         ///< of the carrier now, ramp included; same unit
  double carrier_hz = 0.0;        ///< as configured or last set
  double phase_turns = 0.0;       ///< of the carrier, [0, 1)
  double modulation_turns = 0.0;  ///< of the modulation or of the envelope table, [0, 1)

  friend bool operator==(const Drive&, const Drive&) = default;
};

/// amplitude(t) sin(phase(t)), with phase and ramp carried from step to step, so that a change of
/// frequency, a start and a stop never jump. Does not allocate after construction.
class Excitation {
 public:
  enum class State : std::uint8_t { off, rising, steady, falling };

  explicit Excitation(const config::Excitation& settings);

  /// Ramps up from where the signal is; no effect where the configuration has it disabled.
  void start();

  /// Ramps down to zero within ramp_s; then the state is `off`.
  void stop();

  /// Zero at once: after a fault the amplifier is off anyway.
  void cut();

  /// Changes the carrier; the phase goes on from where it is. carrier_hz > 0.
  void set_carrier_hz(double carrier_hz) { settings_.carrier_hz = carrier_hz; }

  /// Moves time on by `duration_s` >= 0 and returns the signal there.
  Drive advance(double duration_s);

  const Drive& now() const { return now_; }
  State state() const { return state_; }
  bool is_off() const { return state_ == State::off; }
  /// Whether the configuration has it drive at all.
  bool enabled() const { return settings_.enabled; }

 private:
  double unramped_amplitude() const;

  config::Excitation settings_;
  double envelope_length_s_ = 0.0;
  State state_ = State::off;
  double ramp_ = 0.0;  // 0 to 1, linear in time; what is applied is its smooth step
  double envelope_time_s_ = 0.0;
  Drive now_;
};

}  // namespace stickslip::daemon
