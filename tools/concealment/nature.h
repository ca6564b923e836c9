// The rig as it really is, with what its owner does not know: a second simulator, written apart
// from physics::RigSimulator so that a diagnosis is not examined by its own equations. It steps
// velocities by Moreau's midpoint rule with friction taken implicitly (set-valued friction
// exactly), every 25 us, filters by the bilinear transform, and follows other formulas where
// physics offers some: two relaxation processes, Dieterich's ageing, elasto-plastic bristles, Iwan
// elements, Hertz contact. It knows no effect catalogue: every piece of hidden physics is a number
// that is neutral by default.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <random>
#include <vector>

#include "physics/frame.h"
#include "physics/model.h"

namespace stickslip::concealment {

/// amplitude (1 + sum of slow sines) sin(2 pi frequency t + phase): what somebody who turns the
/// knob by hand does to a shaker.
struct Tone {
  double amplitude = 0.0;
  double frequency_hz = 1.0;
  double phase_rad = 0.0;
  struct Envelope {
    double depth = 0.0;
    double frequency_hz = 0.1;
    double phase_rad = 0.0;
  };
  std::array<Envelope, 3> envelope{};
};

struct Motion {
  double value = 0.0;
  double first = 0.0;   ///< derivative [1/s]
  double second = 0.0;  ///< [1/s2]
};

/// The sum of the tones with its derivatives at a time, without error.
Motion motion_of(const std::vector<Tone>& tones, double time_s);

/// How one channel is read.
struct Reading {
  bool recorded = false;
  double noise_std = 0.0;
  double resolution = 0.0;  ///< of the converter; 0: none
  std::vector<physics::Filter> filters;
  double gain = 1.0;
  double leak = 0.0;  ///< share of `leak_from` that is added
  Channel leak_from = Channel::displacement;
  double delay_s = 0.0;
  bool bessel_delay = false;  ///< a second-order Bessel filter with that group delay
  double limit = 0.0;         ///< 0: none
  double hum_hz = 0.0;
  double hum_amplitude = 0.0;
  double hum_wander = 0.0;  ///< relative depth of a slow change of the hum's amplitude
  double drift_per_s = 0.0;
  double drift_settles_s = 0.0;  ///< 0: a ramp; otherwise it approaches rate times this time
};

/// From when to when something acts; by default always.
struct Span {
  double from_s = -1.0e9;
  double to_s = 1.0e9;
};

inline constexpr std::size_t iwan_elements = 5;

struct Nature {
  physics::Excitation excitation = physics::Excitation::base;
  std::vector<Tone> drive;  ///< b [m], F [N] or x [m]
  double mass_kg = 1.0;
  double stiffness_n_m = 0.0;
  double damping_n_s_m = 0.0;
  double well_linear_n_m = 0.0;  ///< restoring force -linear x + cubic x^3, beside the stiffness
  double well_cubic_n_m3 = 0.0;

  bool loaded = true;  ///< false: mu in newtons
  double load_n = 1.0;
  double load_slope_per_m = 0.0;
  double load_curvature_per_m2 = 0.0;

  bool friction = true;
  double mu = 0.0;
  double transition_speed_m_s = 0.0;  ///< 0: set-valued
  double relaxation_per_s = 0.0;      ///< 0: theta = g(v)
  double relaxation_spread = 0.0;  ///< two processes with rates (1 +- spread) of it, same mean lag
  bool cell = false;
  bool cell_rings = false;
  double cell_mass_kg = 1.0;
  double cell_frequency_hz = 20.0;
  double cell_damping_ratio = 0.01;

  // Hidden physics of the friction law.
  double static_ratio = 1.0;
  double stribeck_speed_m_s = 1.0;
  double stribeck_power = 2.0;
  double ageing_beta = 0.0;
  double ageing_tau_s = 1.0;
  double ageing_slip_m = 5.0e-5;
  double bristle_n_m = 0.0;  ///< 0: no compliance
  double bristle_n_s_m = 0.0;
  double bristle_elastic_share = 0.0;  ///< of break-away, below which nothing slips
  double load_exponent = 0.0;
  double asymmetry = 0.0;
  double mu_slope_per_m = 0.0;
  double mu_saturates_m = 0.0;  ///< 0: linear; otherwise slope times length tanh(x / length)
  double mu_drift_per_s = 0.0;
  double mu_settles_s = 0.0;  ///< 0: linear in time
  double ripple = 0.0;        ///< mu (1 + ripple sin(2 pi x / length + phase))
  double ripple_length_m = 0.01;
  double ripple_phase_rad = 0.0;
  double contact_viscosity_n_s_m = 0.0;
  double event_friction = 0.0;  ///< mu (1 + event_friction) during `event`
  // Of the force balance.
  double cubic_n_m3 = 0.0;
  double sinh_length_m = 0.0;  ///< not 0: a sinh spring with this cubic coefficient
  double quadratic_n_m2 = 0.0;
  double drag = 0.0;  ///< drag abs(v)^power sign(v)
  double drag_power = 2.0;
  double iwan_n_m = 0.0;
  double iwan_slip_n = 0.0;
  double stop_gap_m = 0.0;
  double stop_stiffness = 0.0;  ///< N/m^power
  double stop_power = 1.0;
  int stop_side = 0;  ///< 0: both, +1 or -1: one
  double bias_n = 0.0;
  double ambient_n = 0.0;
  double ambient_hz = 1.0;
  double ambient_phase_rad = 0.0;
  double position_damping_n_s_m3 = 0.0;  ///< c x^2 v
  double bump_n = 0.0;                   ///< a magnet's force bump_n s exp((1 - s^2) / 2)
  double bump_at_m = 0.0;                ///< with s = (x - at) / width
  double bump_width_m = 1.0e-3;
  double event_force_n = 0.0;  ///< during `event`
  Span event;
  double mode_hz = 0.0;  ///< 0: no second mode
  double mode_damping_ratio = 0.01;
  double mode_friction_per_kg = 0.0;
  double mode_base_share = 0.0;

  double differentiator_hz = 0.0;  ///< 0: as the filters of the velocity channel say
  std::array<Reading, channel_count> reading;
};

/// A run of a rig. A copy goes on from where the original stands; the numbers of the rig may be
/// changed between two samples.
class RigRun {
 public:
  /// Starts `warm_up_s` before time 0, at rest, and settles until then.
  RigRun(const Nature& nature, double warm_up_s);

  double time_s() const { return time_s_; }
  void replace(const Nature& nature);
  /// Moves on to `time_s`.
  void advance(double time_s);
  /// What every channel says, free of noise and steps of the converter.
  std::array<double, channel_count> read() const;
  /// Share of the steps so far in which the contact slips.
  double slip_share() const;

 private:
  // A filter of second order, in transposed direct form II.
  struct Section {
    double b0 = 1.0, b1 = 0.0, b2 = 0.0, a1 = 0.0, a2 = 0.0;
    double s1 = 0.0, s2 = 0.0;
    double step(double in) {
      const double out = b0 * in + s1;
      s1 = b1 * in - a1 * out + s2;
      s2 = b2 * in - a2 * out;
      return out;
    }
  };
  static void add_lowpass(std::vector<Section>& chain, int order, double cutoff_hz);
  static void add_bessel(std::vector<Section>& chain, double delay_s);

  struct Mechanics {
    double x = 0.0, v = 0.0, y = 0.0, w = 0.0, q = 0.0, qv = 0.0;
    double theta_fast = 0.0, theta_slow = 0.0, bristle = 0.0, rested_s = 0.0;
    double slip = 0.0, friction = 0.0, load = 0.0;
    std::array<double, iwan_elements> iwan{};
  };

  double load_at(double x) const;
  // Friction force for a slip speed at the middle of a step, states moved there from its beginning.
  double friction_at(double slip, double x, double load, double time_s, Mechanics& middle) const;
  double static_force(double x, double time_s) const;
  void step();
  void build_chains();
  void sense();

  Nature nature_;
  double time_s_ = 0.0;
  std::int64_t step_number_ = 0;
  std::int64_t slipping_steps_ = 0;
  std::int64_t all_steps_ = 0;
  Mechanics at_;
  std::array<std::vector<Section>, channel_count> chain_;
  std::vector<Section> differentiator_;
  double last_displacement_ = 0.0;
  bool sensed_ = false;
  std::array<std::deque<double>, channel_count> line_;  // what a pure delay holds
  std::array<double, channel_count> now_{};
};

inline constexpr double nature_step_s = 25.0e-6;

}  // namespace stickslip::concealment
