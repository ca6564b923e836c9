// SPDX-License-Identifier: Apache-2.0
// The reference simulator: the true rig with its hidden effects. Independent of
// physics::RigSimulator, so that a diagnosis is not examined on its own equations: Moreau's
// midpoint rule at 25 us with implicit (also set-valued) friction, filters by the bilinear
// transform, and other formulas where physics offers some: two relaxation processes, Dieterich's
// ageing, elasto-plastic, LuGre and Dahl bristles, Iwan elements, Hertz contact. It does not use
// the effect catalogue: every hidden effect is a parameter that is neutral by default.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <vector>

#include "physics/frame.h"
#include "physics/model.h"
#include "physics/simulator.h"

namespace stickslip::concealment {

/// amplitude (1 + sum of slow sines) sin(2 pi frequency t + phase): a shaker whose amplitude is
/// turned by hand.
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

/// The sum of the tones and its exact derivatives.
Motion motion_of(const std::vector<Tone>& tones, double time_s);

/// A slow function of time: linear between knots that are `step_s` apart from time 0 on, constant
/// beyond; 0 without knots.
struct Wander {
  double step_s = 1.0;
  std::vector<double> knots;
  double at(double time_s) const;
};

/// One sensor channel with its errors.
struct Instrument {
  bool recorded = false;
  double noise_std = 0.0;
  double correlated_share = 0.0;     ///< of the variance of the noise; the rest is white
  double noise_correlation_s = 0.0;  ///< time constant of the correlated share
  double resolution = 0.0;           ///< quantisation step; 0: none
  std::vector<physics::Filter> filters;
  double gain = 1.0;
  double crosstalk = 0.0;  ///< share of `crosstalk_from` that is added
  Channel crosstalk_from = Channel::displacement;
  double delay_s = 0.0;
  bool bessel_delay = false;  ///< a second-order Bessel filter with that group delay
  double limit = 0.0;         ///< saturation; 0: none
  double hum_hz = 0.0;
  double hum_amplitude = 0.0;
  Wander hum_wander;  ///< the hum's amplitude is hum_amplitude (1 + wander)
  double offset = 0.0;
  double drift_per_s = 0.0;
  double drift_settling_s = 0.0;  ///< 0: a ramp; otherwise the time constant of an exponential
  Wander drift_wander;            ///< added to the drift
};

/// Time during which an effect acts; by default always.
struct Interval {
  double from_s = -1.0e9;
  double to_s = 1.0e9;
};

inline constexpr std::size_t iwan_elements = 5;

/// Parameters of the true rig.
struct ReferenceRig {
  physics::Excitation excitation = physics::Excitation::base;
  std::vector<Tone> drive;  ///< b [m], F [N] or x [m]
  double mass_kg = 1.0;
  double stiffness_n_m = 0.0;
  double damping_n_s_m = 0.0;
  double well_linear_n_m =
      0.0;  ///< restoring force -linear x + cubic x^3, in addition to the stiffness
  double well_cubic_n_m3 = 0.0;

  bool loaded = true;  ///< false: mu in newtons
  double load_n = 1.0;
  double load_slope_per_m = 0.0;
  double load_curvature_per_m2 = 0.0;

  bool friction = true;
  double mu = 0.0;
  double transition_speed_m_s = 0.0;  ///< 0: set-valued
  double relaxation_per_s = 0.0;      ///< 0: theta = g(v)
  double relaxation_share = 0.5;      ///< two processes: share of the faster one
  double relaxation_ratio = 1.0;      ///< of their rates; the mean lag is that of one process
  bool cell = false;
  bool cell_rings = false;
  double cell_mass_kg = 1.0;
  double cell_frequency_hz = 20.0;
  double cell_damping_ratio = 0.01;

  // Hidden effects: friction law.
  double static_ratio = 1.0;
  double stribeck_speed_m_s = 1.0;
  double stribeck_power = 2.0;
  double ageing_beta = 0.0;
  double ageing_tau_s = 1.0;
  double ageing_slip_m = 5.0e-5;
  double bristle_n_m = 0.0;  ///< 0: no compliance
  double bristle_n_s_m = 0.0;
  double bristle_elastic_share = 0.0;  ///< of break-away, below which there is no slip
  double dahl_exponent = 0.0;  ///< not 0: Dahl's bristle, z' = v (1 - z sign(v) / z_max)^exponent
  double bristle_damping_speed_m_s = 0.0;  ///< not 0: its damping falls with exp(-(v / speed)^2)
  double load_exponent = 0.0;
  bool load_logarithmic = false;  ///< 1 + exponent ln(N / N0) in place of the power
  double asymmetry = 0.0;
  double asymmetry_speed_m_s = 0.0;  ///< 0: by the sign of v; otherwise by tanh(v / speed)
  double mu_slope_per_m = 0.0;
  double mu_saturation_m = 0.0;  ///< 0: linear; otherwise slope times length tanh(x / length)
  double mu_drift_per_s = 0.0;
  double mu_settling_s = 0.0;  ///< 0: linear in time
  double ripple = 0.0;         ///< mu (1 + ripple sin(2 pi x / length + phase))
  double ripple_length_m = 0.01;
  double ripple_phase_rad = 0.0;
  double contact_viscosity_n_s_m = 0.0;
  double event_friction = 0.0;  ///< mu (1 + event_friction) during `event`
  // Hidden effects: force balance.
  double cubic_n_m3 = 0.0;
  double sinh_length_m = 0.0;  ///< not 0: a sinh spring with this cubic coefficient
  double quadratic_n_m2 = 0.0;
  double drag = 0.0;  ///< drag abs(v)^power sign(v)
  double drag_power = 2.0;
  double iwan_n_m = 0.0;
  double iwan_slip_n = 0.0;
  std::array<double, iwan_elements> iwan_stiffness_share = {0.2, 0.2, 0.2, 0.2, 0.2};
  std::array<double, iwan_elements> iwan_slip_share = {1.0 / 15.0, 2.0 / 15.0, 3.0 / 15.0,
                                                       4.0 / 15.0, 5.0 / 15.0};
  double stop_gap_m = 0.0;
  double stop_stiffness = 0.0;  ///< N/m^power
  double stop_power = 1.0;
  int stop_side = 0;  ///< 0: both, +1 or -1: one
  double bias_n = 0.0;
  double ambient_n = 0.0;
  double ambient_hz = 1.0;
  double ambient_phase_rad = 0.0;
  double ambient_harmonic = 0.0;         ///< share of a second harmonic
  double position_damping_n_s_m3 = 0.0;  ///< c x^2 v
  double bump_n = 0.0;                   ///< a magnet's force bump_n s exp((1 - s^2) / 2)
  double bump_at_m = 0.0;                ///< with s = (x - at) / width
  double bump_width_m = 1.0e-3;
  double event_force_n = 0.0;  ///< during `event`
  Interval event;
  double mode_hz = 0.0;  ///< 0: no second mode
  double mode_damping_ratio = 0.01;
  double mode_friction_per_kg = 0.0;
  double mode_base_share = 0.0;

  double differentiator_hz = 0.0;  ///< 0: the filters of the velocity channel
  std::array<Instrument, channel_count> instrument;
};

/// A run of a rig. A copy continues independently from the same state.
class ReferenceSimulator {
 public:
  /// Starts at rest `warm_up_s` before time 0 and advances to it.
  ReferenceSimulator(const ReferenceRig& rig, double warm_up_s);

  double time_s() const { return time_s_; }
  /// Changes the parameters between two samples; the state is kept.
  void replace(const ReferenceRig& rig);
  void advance(double time_s);
  /// Readings of all channels without noise and quantisation.
  std::array<double, channel_count> read() const { return readings_; }
  /// The state behind the readings; friction force and slip velocity are those of the middle of the
  /// last step. theta is that of the backbone, without hidden effects; with a bristle or a
  /// set-valued law it is friction over mu N, 0 where the pads do not touch.
  physics::RigTruth truth() const;
  /// Share of the steps since time 0 in which the contact slips.
  double slip_share() const;

 private:
  using Channels = std::array<double, channel_count>;

  // Second-order filter in transposed direct form II.
  struct Biquad {
    double b0 = 1.0, b1 = 0.0, b2 = 0.0, a1 = 0.0, a2 = 0.0;
    double s1 = 0.0, s2 = 0.0;
    double step(double in) {
      const double out = b0 * in + s1;
      s1 = b1 * in - a1 * out + s2;
      s2 = b2 * in - a2 * out;
      return out;
    }
  };
  static void add_lowpass(std::vector<Biquad>& chain, int order, double cutoff_hz);
  static void add_bessel(std::vector<Biquad>& chain, double delay_s);

  struct State {
    double x = 0.0, v = 0.0, y = 0.0, w = 0.0, q = 0.0, qv = 0.0;
    double theta_fast = 0.0, theta_slow = 0.0, bristle = 0.0, rested_s = 0.0;
    double slip = 0.0, friction = 0.0, load = 0.0;
    std::array<double, iwan_elements> iwan{};
  };
  struct Contact {
    double slip = 0.0;
    double friction = 0.0;
  };
  // A body at the middle of a step, under all forces but friction.
  struct FreeBody {
    double velocity = 0.0;
    double inertia = 1.0;
  };

  double load_at(double x) const;
  // The friction functions take the slip speed at the middle of a step and move the internal states
  // of `middle` there from the beginning of the step.
  double friction_level(double slip, double x, double load, double time_s, State& middle) const;
  double slip_share_of_bristle(double bent) const;
  double bristle_friction(double slip, double level, State& middle) const;
  double relaxed(const State& state) const;
  double backbone_friction(double slip, double level, State& middle) const;
  double friction_at(double slip, double x, double load, double time_s, State& middle) const;
  Contact solve_contact(double free_slip, double mobility, double x, double load, double time_s,
                        State& middle) const;
  double static_force(double x, double time_s) const;
  double iwan_break_away_m(std::size_t element) const;
  double iwan_force(State& middle) const;
  FreeBody free_mass(double x, double force) const;
  FreeBody free_load_cell(double base_acceleration) const;

  void step();
  Contact step_imposed(const Motion& drive, double middle_s, State& middle);
  Contact step_free(const Motion& drive, double middle_s, State& middle);
  void advance_second_mode(double friction, double base_acceleration);

  double theta() const;
  void build_chains();
  void update_readings();
  Channels true_quantities(const Motion& drive) const;
  Channels filtered(const Channels& quantity);
  double delayed(std::size_t channel, double value);

  ReferenceRig rig_;
  double time_s_ = 0.0;
  std::int64_t step_number_ = 0;
  std::int64_t slipping_steps_ = 0;
  std::int64_t all_steps_ = 0;
  State state_;
  std::array<std::vector<Biquad>, channel_count> chain_;
  std::vector<Biquad> differentiator_;
  double last_displacement_ = 0.0;
  bool has_last_displacement_ = false;
  std::array<std::deque<double>, channel_count> delay_line_;
  Channels readings_{};
};

inline constexpr double reference_step_s = 25.0e-6;

}  // namespace stickslip::concealment
