// A recording made ready for models to be held against it: a uniform time grid, what the channels
// read, what drove the rig, how noisy each channel is, first guesses of the states, and the windows
// in which predictions are made.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "physics/frame.h"
#include "physics/model.h"
#include "physics/simulator.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

/// The channels that a model predicts; the others are its inputs.
inline constexpr std::size_t predicted_channels = 4;

/// A stretch of samples: the model starts at `warm` with a free state, its sensor filters settle
/// until `begin`, and it is compared with the recording from `begin` to before `end`.
struct Window {
  std::size_t warm = 0;
  std::size_t begin = 0;
  std::size_t end = 0;
  bool held_out = false;  ///< no parameter is ever fitted to it
};

/// A first guess of the mechanical state at a sample, from the wide-band channels.
struct StateGuess {
  double displacement_m = 0.0;
  double velocity_m_s = 0.0;
  double load_cell_deflection_m = 0.0;
  double load_cell_velocity_m_s = 0.0;
  double friction_n = 0.0;
};

struct Experiment {
  std::string source;
  double start_s = 0.0;  ///< time of sample 0 in the recording
  double period_s = 0.0;
  int substeps = 1;  ///< integration steps per sample
  std::size_t samples = 0;
  std::vector<std::array<double, predicted_channels>> reading;
  std::vector<std::uint8_t> valid;    ///< bits by channel: compare this sample
  std::uint8_t compared = 0;          ///< bits by channel: the model predicts what was recorded
  std::vector<physics::Input> input;  ///< (samples - 1) * substeps + 1 instants
  std::vector<StateGuess> guess;      ///< one per sample
  std::array<double, channel_count> noise_std{};  ///< declared or estimated; 0: not recorded
  std::array<bool, channel_count> noise_declared{};
  std::array<bool, channel_count> noise_assumed{};  ///< smoother than any model is right
  std::array<double, channel_count> channel_std{};  ///< standard deviation of the recording
  double base_doubt_m_s2 =
      0.0;             ///< what the acceleration of the base is wrong by, standard deviation
  StateGuess largest;  ///< largest magnitude of each guessed quantity
  double mean_load_n = 1.0;
  std::size_t usable_begin = 0;  ///< samples near the ends are used for filters only
  std::size_t usable_end = 0;
  std::vector<std::size_t> gaps;  ///< samples at which a new stretch begins
  std::vector<Window> windows;

  double time_s(std::size_t sample) const {
    return start_s + period_s * static_cast<double>(sample);
  }
};

/// How finely the model is integrated: finely enough to be judged by the noise, or so that a
/// comparison of candidates costs less.
enum class Steps : std::uint8_t { fine, rough };

/// Throws InputError where the recording lacks what the model needs (a base-excited rig needs
/// base_displacement_m, a force-excited one drive_force_n, imposed motion displacement_m, and
/// something to compare with), or is too short.
Experiment make_experiment(const protocol::Recording& recording, const physics::Model& model,
                           Steps steps = Steps::fine);

/// Cuts the usable part into windows of `horizon_s`; of every three blocks of windows one is held
/// out. Throws InputError for a horizon of fewer than eight samples.
void cut_windows(Experiment& experiment, const physics::Model& model, double horizon_s);

/// A prediction horizon that suits the model: 0.4 s, longer for slow rigs.
double default_horizon_s(const physics::Model& model, const Experiment& experiment);

}  // namespace stickslip::diagnosis
