// A recording prepared for comparison with models: uniform time grid, readings, inputs, noise of
// each channel, first guesses of the states, and the windows in which predictions are made.
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

/// Channels that a model predicts, the first ones; the others are its inputs.
inline constexpr std::size_t predicted_channels = 4;

/// Consecutive samples: the model starts at `warm` with a free state, its sensor filters settle
/// until `begin`, and it is compared with the recording from `begin` to before `end`.
struct Window {
  std::size_t warm = 0;
  std::size_t begin = 0;
  std::size_t end = 0;
  bool held_out = false;  ///< no parameter is ever fitted to it
};

/// First guess of the mechanical state at a sample, from the wide-band channels.
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
  std::vector<std::uint8_t> valid;    ///< by sample, bits by channel: compare this reading
  std::uint8_t compared = 0;          ///< bits by channel: predicted by the model and recorded
  std::vector<physics::Input> input;  ///< (samples - 1) * substeps + 1 instants
  std::vector<StateGuess> guess;      ///< one per sample
  std::array<double, channel_count> noise_std{};  ///< declared or estimated; 0: not recorded
  std::array<bool, channel_count> noise_declared{};
  /// The estimate was below the accuracy of any model and was replaced by a lower bound.
  std::array<bool, channel_count> noise_assumed{};
  std::array<double, channel_count> channel_std{};  ///< standard deviation of the recording
  /// Standard deviation of the drive as derived from its noisy channel: of the base's acceleration
  /// [m/s^2], or of the velocity of an imposed motion [m/s].
  double drive_noise = 0.0;
  StateGuess largest;  ///< largest magnitude of each guessed quantity
  double mean_load_n = 1.0;
  std::size_t usable_begin = 0;  ///< samples near the ends only feed filters
  std::size_t usable_end = 0;
  std::vector<std::size_t> gaps;  ///< first samples after gaps
  std::vector<Window> windows;

  double time_s(std::size_t sample) const {
    return start_s + period_s * static_cast<double>(sample);
  }
  /// True if models are compared with the reading of channel c at sample k.
  bool is_compared(std::size_t k, std::size_t c) const { return ((valid[k] >> c) & 1U) != 0; }
  /// True if models are compared with channel c.
  bool is_compared(std::size_t c) const { return ((compared >> c) & 1U) != 0; }
};

/// Calls visit(sample, channel) for every compared reading in [begin, end), sample by sample.
template <class Visit>
void for_each_compared(const Experiment& e, std::size_t begin, std::size_t end, Visit&& visit) {
  for (std::size_t k = begin; k < end; ++k) {
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (e.is_compared(k, c)) visit(k, c);
    }
  }
}

/// Integration steps: fine enough for residuals at the level of the noise, or coarse, for the
/// screening of candidates.
enum class Steps : std::uint8_t { fine, coarse };

/// Throws InputError where the recording lacks what the model needs (a base-excited rig needs
/// base_displacement_m, a force-excited one drive_force_n, imposed motion displacement_m, and
/// something to compare with), or is too short.
Experiment make_experiment(const protocol::Recording& recording, const physics::Model& model,
                           Steps steps = Steps::fine);

/// Cuts the usable part into windows of `horizon_s` and holds out one third of the blocks of
/// windows. Throws InputError for a horizon of fewer than eight samples.
void cut_windows(Experiment& experiment, const physics::Model& model, double horizon_s);

/// Prediction horizon for a model: one period of its oscillator, within 0.4 to 1.5 s and at most a
/// 24th of the recording.
double default_horizon_s(const physics::Model& model, const Experiment& experiment);

}  // namespace stickslip::diagnosis
