// SPDX-License-Identifier: Apache-2.0
// A recording prepared for comparison with models: uniform time grid, readings, inputs, noise of
// each channel, first guesses of the states, and the windows in which predictions are made.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/noise_floor.h"
#include "physics/frame.h"
#include "physics/model.h"
#include "physics/simulator.h"
#include "protocol/recording.h"

namespace stickslip::diagnosis {

/// Channels that a model predicts, the first ones; the others are its inputs.
inline constexpr std::size_t predicted_channels = 4;

/// Most knots of the linear spline that models the error of the drive in one window.
inline constexpr int max_drive_knots = 48;

/// Integration steps: fine enough for residuals at the level of the noise, or coarse, for their
/// derivatives and for the screening of candidates.
enum class Steps : std::uint8_t { fine, coarse };

/// Use of a window. A result is only as good as it is on data that had no part in it: windows that
/// choose among hypotheses are no proof of the one that was chosen.
enum class Use : std::uint8_t {
  fit,     ///< parameters are fitted to it
  select,  ///< hypotheses are compared on it
  report,  ///< not looked at before the result stands
};

/// Shares of all windows, the rest for the report.
inline constexpr double fit_share = 2.0 / 3.0;
inline constexpr double select_share = 0.25;

/// Consecutive samples: the model starts at `warm` with a free state, its sensor filters settle
/// until `begin`, and it is compared with the recording from `begin` to before `end`.
struct Window {
  std::size_t warm = 0;
  std::size_t begin = 0;
  std::size_t end = 0;
  Use use = Use::fit;
};

/// First guess of the mechanical state at a sample, from the wide-band channels.
struct StateGuess {
  double displacement_m = 0.0;
  double velocity_m_s = 0.0;
  double load_cell_deflection_m = 0.0;
  double load_cell_velocity_m_s = 0.0;
  double friction_n = 0.0;
};

/// Samples without a gap, in which everything that a model is driven by was measured. Filters and
/// states start anew behind a gap; nothing is reconstructed across one. At least one sample between
/// two segments belongs to neither.
struct Segment {
  std::size_t begin = 0;
  std::size_t end = 0;
  std::size_t usable_begin = 0;  ///< nearer to an end, inputs are inaccurate
  std::size_t usable_end = 0;
  double start_s = 0.0;  ///< time of `begin`, after that of sample 0
};

struct Experiment {
  std::string source;
  std::size_t recording = 0;  ///< its place in a campaign
  double start_s = 0.0;       ///< time of sample 0 in the recording
  double period_s = 0.0;
  int substeps = 1;         ///< integration steps per sample, fine ones
  int coarse_substeps = 1;  ///< coarse ones; a divisor of the former
  std::size_t samples = 0;
  std::vector<std::array<double, predicted_channels>> reading;
  /// Times of measurement after the instants of the grid [s], by sample; empty: all at them.
  std::vector<std::array<float, predicted_channels>> measured_after_s;
  std::vector<std::uint8_t> valid;    ///< by sample, bits by channel: compare this reading
  std::uint8_t compared = 0;          ///< bits by channel: predicted by the model and recorded
  std::vector<physics::Input> input;  ///< (samples - 1) * substeps + 1 instants
  /// The same, were the cut-offs of the drive's channel higher by this share and its lag the same;
  /// empty where the channel has no filters.
  std::vector<physics::Input> input_at_higher_cutoff;
  static constexpr double higher_cutoff = 0.05;
  std::vector<StateGuess> guess;                     ///< one per sample
  std::array<double, channel_count> noise_std{};     ///< declared or estimated; 0: not recorded
  std::array<bool, channel_count> noise_declared{};  ///< and not contradicted by the readings
  std::array<double, channel_count> noise_above_declared{};  ///< noise_std over the declared one
  /// The estimate was below the accuracy of any model and was replaced by a lower bound.
  std::array<bool, channel_count> noise_assumed{};
  std::array<double, channel_count> channel_std{};  ///< standard deviation of the recording
  /// Noise over that of the noisiest recording, where each has its own.
  std::array<double, predicted_channels> noise_ratio = {1.0, 1.0, 1.0, 1.0};
  /// Standard deviation of the drive as derived from its noisy channel, at each of `drive_knots`:
  /// of the base's acceleration [m/s^2], of the velocity of an imposed motion [m/s], or of a drive
  /// force, averaged over the distance of two knots [N].
  double drive_noise = 0.0;
  NoiseFloor drive_force_noise{0.0};  ///< by reading [N^2]
  double drive_force_period_s = 0.0;  ///< between its readings
  double drive_band_hz = 0.0;         ///< highest frequency of the drive as derived
  int drive_knots =
      0;               ///< of the spline that models its error in a window; at most max_drive_knots
  StateGuess largest;  ///< largest magnitude of each guessed quantity
  double mean_load_n = 1.0;
  std::size_t usable_begin = 0;   ///< of the first segment
  std::size_t usable_end = 0;     ///< of the last one
  std::vector<Segment> segments;  ///< in order; empty: all samples are one
  std::vector<Window> windows;

  int steps_per_sample(Steps steps) const {
    return steps == Steps::fine ? substeps : coarse_substeps;
  }
  /// The segment of a sample; of one in a gap, that before it.
  Segment segment_of(std::size_t sample) const;
  Segment longest_segment() const;
  /// Time after sample 0. A gap takes one sample, however long it lasts.
  double elapsed_s(std::size_t sample) const;
  /// Time in the recording.
  double time_s(std::size_t sample) const { return start_s + elapsed_s(sample); }
  /// From sample 0 to the end of the last one, gaps included.
  double duration_s() const;
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

/// Throws InputError where the recording lacks what the model needs (a base-excited rig needs
/// base_displacement_m, a force-excited one drive_force_n, imposed motion displacement_m, and
/// something to compare with), is too short, or has fewer than three samples in a natural period of
/// the model: then the times are in another unit. Outliers count as not measured.
Experiment make_experiment(const protocol::Recording& recording, const physics::Model& model);

/// The channel from which a recording's excitation is taken.
Channel drive_channel(physics::Excitation excitation);

/// Cuts the usable part of each segment into windows of `horizon_s`: eight of twelve to fit, three
/// to select, and one to report, in blocks. Throws InputError for a horizon of fewer than
/// eight samples.
void cut_windows(Experiment& experiment, const physics::Model& model, double horizon_s);

/// Prediction horizon for a model: one period of its oscillator, within 0.4 to 1.5 s and at most a
/// 24th of the recording.
double default_horizon_s(const physics::Model& model, const Experiment& experiment);

}  // namespace stickslip::diagnosis
