// SPDX-License-Identifier: Apache-2.0
// Noise model of the filter: noise of readings, process noise, adaptive noise of the drive, and the
// initial state with its covariance.
#pragma once

#include <array>
#include <vector>

#include "observer/covariance.h"
#include "observer/input_noise.h"
#include "observer/layout.h"
#include "physics/frame.h"
#include "physics/model.h"
#include "physics/rig.h"

namespace stickslip::observer {

/// Prior of mu and gamma at the start.
enum class FrictionPrior {
  from_model,      ///< the model's values with their standard deviations
  from_recording,  ///< values estimated before from the same recording
};

/// Variances of the readings of the measured inputs [unit of the channel squared].
struct InputVariances {
  double drive = 0.0;
  double load = 0.0;
};

/// Relative error of the friction law's backbone g. Its part that varies is noise, correlated over
/// 10 ms; its part that does not is an error of mu, however long the recording.
inline constexpr double backbone_std = 0.002;

class NoiseModel {
 public:
  NoiseModel(const physics::Model& model, const physics::Rig& rig, const Layout& layout,
             const physics::RigNumbers<double>& numbers, double period_s, FrictionPrior prior);

  /// Takes over what another one has found out about the readings' noise, where it is not declared,
  /// and about the bandwidth of drive and load.
  void continue_from(const NoiseModel& before);

  /// Initial state and covariance from a first frame. `mu`: previous estimate, ignored where it is
  /// implausible; 0: none.
  void initialise(const Frame& frame, double mu, Vector& mean, Covariance& covariance) const;

  /// Adds the process noise of one period to the covariance of the core and the sensor errors.
  /// `slip_variance`: of the slip velocity [(m/s)^2]. `since_start_s`: since the filter was
  /// initialised. `readings`: as the filter uses them.
  void add_process_noise(const Vector& mean, double slip_variance, double since_start_s,
                         const InputVariances& readings, Covariance& covariance) const;

  /// Adds the uncertainty of the friction law to friction and theta where theta has no memory, and
  /// to the chain of the force where friction is its input: that of the law itself, and what its
  /// statistical linearisation neglects for a slip velocity of this variance [(m/s)^2].
  void add_output_noise(const Vector& mean, double slip_variance, Covariance& covariance) const;

  /// Factor on the gain of mu, 0 to 1: 1 while the contact slides, 0 while it sticks. A sticking
  /// contact observes the product mu theta only, which a linearised filter would distribute
  /// arbitrarily.
  double mu_gain_factor(const Vector& mean, double slip_variance) const;

  /// Limits states to their physical range.
  void constrain(Vector& mean) const;

  /// True if mu or gamma is beyond any value plausible for this model: a diverged filter can fit
  /// every reading there.
  bool is_implausible(const Vector& mean) const;

  /// Updates the noise of channels without noise_std; to be called with every frame.
  void estimate_reading_noise(const Frame& frame);

  /// Variance of a reading's noise [unit of the channel squared].
  double reading_variance(Channel channel) const;

  /// Adapts the process noise of a measured input, the drive or the normal load, to its channel's
  /// normalised innovation; other channels have no effect.
  void adapt_input_noise(Channel channel, double normalised_innovation);

 private:
  /// Noise of a channel, estimated from third differences of its readings.
  struct ReadingNoise {
    double declared = 0.0;  ///< variance; 0: not declared
    std::array<double, 3> last{};
    int in_a_row = 0;
    double count = 0.0;
    double variance = 0.0;
    double largest = 0.0;  ///< magnitude of readings
  };
  /// Magnitudes at the start, from the model and the first frame.
  struct Scales {
    double load = 0.0, friction = 0.0;  ///< [N]
    double load_std = 0.0;              ///< of a measured load; not 0 where the first reading is 0
    double length = 0.0;                ///< [m]
    double speed = 0.0;                 ///< [m/s]
    double drive = 0.0;                 ///< [m] or [N]
    double drive_rad_s = 0.0;
  };
  class InitialState;

  Scales scales(const Frame& frame) const;
  void initialise_rig(const Frame& frame, const Scales& scale, InitialState& out) const;
  void initialise_parameters(double mu, const Scales& scale, InitialState& out) const;
  void initialise_chains(const Frame& frame, const Scales& scale, InitialState& out) const;
  void add_force_noise(const Vector& mean, double slip_variance, Covariance& covariance) const;
  void add_parameter_noise(double since_start_s, Covariance& covariance) const;
  void add_sensor_error_noise(Covariance& covariance) const;
  void add_drive_noise(const Vector& mean, double variance, Covariance& covariance) const;
  void add_load_noise(double variance, Covariance& covariance) const;
  double initial_deviation(double from_model, double from_recording) const;
  double backbone_variance(const Vector& mean, double slip_variance) const;
  double sliding_friction(const Vector& mean) const;
  void find_force_response(const physics::Model& model);

  const physics::Model* model_;
  const physics::Rig* rig_;
  const Layout* layout_;
  const physics::RigNumbers<double>* numbers_;
  double period_s_;
  FrictionPrior prior_;
  double natural_rad_s_;
  double log_rate_;                       ///< ln of the model's gamma
  double spring_std_n_m_, cell_std_n_m_;  ///< of unmodelled forces
  /// States of the force's chain whose input is the friction force, and their values after a period
  /// with a friction force of 1 N.
  struct Driven {
    int state;
    double value;
  };
  std::vector<Driven> force_response_;
  InputNoise drive_noise_, load_noise_;
  std::array<ReadingNoise, channel_count> reading_noise_;
};

}  // namespace stickslip::observer
