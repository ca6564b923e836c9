// What the filter does not know: how noisy a reading is, how far the model is from the rig, how
// wild the drive is, and how little it knows at its start.
#pragma once

#include <array>

#include "observer/covariance.h"
#include "observer/layout.h"
#include "physics/frame.h"
#include "physics/model.h"
#include "physics/rig.h"

namespace stickslip::observer {

/// What is known of mu and gamma at the start.
enum class Contact : std::uint8_t {
  to_be_learnt,  ///< what the model says, with its doubt
  learnt,        ///< what this recording itself said, when it was gone through before
  known,         ///< what the model says, without doubt: nothing is learnt
};

class Noise {
 public:
  Noise(const physics::Model& model, const physics::Rig& rig, const Layout& layout,
        const physics::RigNumbers<double>& numbers, double period_s, Contact contact);

  /// State and covariance as a first frame gives them. `mu`: an estimate to go on with, which is
  /// dropped where it is absurd; 0 where there is none.
  void start(const Frame& frame, double mu, Vector& mean, Covariance& covariance) const;

  /// Adds what one period adds to the doubt about the core. `slip_variance`: of the slip velocity
  /// [(m/s)^2]. `since_start_s`: since the filter began. `drive_variance`: of the drive's readings,
  /// as the filter uses them.
  void add_process(const Vector& mean, double slip_variance, double since_start_s,
                   double drive_variance, Covariance& covariance) const;

  /// Adds the doubt of the friction law itself to friction and theta where they have no memory.
  void add_output(const Vector& mean, Covariance& covariance) const;

  /// How much a frame may teach about mu: 1 where the contact slides, 0 where it sticks. A sticking
  /// contact shows mu theta only, and a linearised filter would share that out at random.
  double lesson(const Vector& mean, double slip_variance) const;

  /// Keeps states inside what they can mean.
  void confine(Vector& mean) const;

  /// Whether mu or gamma have gone where no contact of this model would be: a filter that has lost
  /// its way can explain every reading there.
  bool is_absurd(const Vector& mean) const;

  /// Hears every frame: where no noise_std is declared it is estimated from the readings.
  void listen(const Frame& frame);

  /// Variance of the noise of a reading [unit of the channel squared].
  double reading_variance(Channel channel) const;

  /// Makes the drive's model wilder or tamer, by whether its channel's innovations, over their
  /// expected deviation, are too large and go on in one direction.
  void learn_drive(double normalised_innovation);

 private:
  struct Listener {
    double declared = 0.0;  ///< variance; 0: not declared
    std::array<double, 3> last{};
    int in_a_row = 0;
    double heard = 0.0;
    double variance = 0.0;
    double size = 0.0;
  };

  double doubt_at_start(double unlearnt, double learnt) const;
  double backbone_variance(const Vector& mean, double slip_variance) const;
  double friction_level(const Vector& mean) const;

  const physics::Model* model_;
  const physics::Rig* rig_;
  const Layout* layout_;
  const physics::RigNumbers<double>* numbers_;
  double period_s_;
  Contact contact_;
  double natural_rad_s_;
  double log_rate_;  ///< of what the model says of gamma
  double spring_doubt_n_m_, damping_doubt_n_s_m_, mass_doubt_kg_, cell_doubt_n_m_;
  double drive_trend_ = 0.0;
  double log_jerk_density_, least_log_density_, most_log_density_;
  std::array<Listener, channel_count> listeners_;
};

}  // namespace stickslip::observer
