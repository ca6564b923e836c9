// What the filter does not know: how noisy a reading is, how far the model is from the rig, how
// wild the drive is, and how little it knows at its start.
#pragma once

#include <array>

#include "daemon/observer/layout.h"
#include "physics/frame.h"
#include "physics/model.h"
#include "physics/rig.h"

namespace stickslip::observer {

class Noise {
 public:
  Noise(const physics::Model& model, const physics::Rig& rig, const Layout& layout,
        const physics::RigNumbers<double>& numbers, double period_s);

  /// State and covariance as a first frame gives them. `mu`: an estimate to go on with, which is
  /// dropped where it is absurd; 0 where there is none.
  void start(const Frame& frame, double mu, Vector& mean, Matrix& covariance) const;

  /// Adds what one period adds to the doubt about the core.
  void add_process(const Vector& mean, Matrix& covariance) const;

  /// Keeps states inside what they can mean.
  void confine(Vector& mean) const;

  /// Hears every frame: where no noise_std is declared it is estimated from the readings.
  void listen(const Frame& frame);

  /// Variance of the noise of a reading [unit of the channel squared].
  double reading_variance(Channel channel) const;

  /// Makes the drive's model wilder or tamer, by how its channel's squared innovation compares with
  /// its expected value.
  void learn_drive(double normalised_square);

 private:
  struct Listener {
    double declared = 0.0;  ///< variance; 0: not declared
    std::array<double, 3> last{};
    int in_a_row = 0;
    double heard = 0.0;
    double variance = 0.0;
    double size = 0.0;
  };

  const physics::Model* model_;
  const physics::Rig* rig_;
  const Layout* layout_;
  const physics::RigNumbers<double>* numbers_;
  double period_s_;
  double natural_rad_s_;
  double spring_doubt_n_m_, damping_doubt_n_s_m_, mass_doubt_kg_, cell_doubt_n_m_;
  double log_jerk_density_, least_log_density_, most_log_density_;
  std::array<Listener, channel_count> listeners_;
};

}  // namespace stickslip::observer
