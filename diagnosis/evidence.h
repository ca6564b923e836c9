// SPDX-License-Identifier: Apache-2.0
// Residuals before and after the findings of a diagnosis, and the recording with both predictions,
// for the figures of a report. The part of a residual that the noise of the base's own channel
// explains is removed from it and from the predictions, as in the scores of models.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// The recording and both predictions over a stretch; predictions restart with every window.
struct Traces {
  std::vector<double> time_s, recorded, before, after;
};

/// before: the calibrated declared model; after: with all findings, the same where there are none.
struct ChannelEvidence {
  Channel channel = Channel::displacement;
  double sigma = 0.0;  ///< noise that whitens residuals, in the channel's unit
  /// Mean square of the residual over the noise variance, by window of Evidence::windows; NaN where
  /// the channel was not recorded.
  std::vector<double> window_before, window_after;
  /// Mean power of the whitened residual by frequency; 1 is white noise.
  std::vector<double> frequency_hz, power_before, power_after;
  /// Root mean square of the whitened residual by the phase of the drive; NaN at phases without
  /// data.
  std::vector<double> phase_deg, phase_before, phase_after;
  /// Over the worst stretch and over the typical one.
  Traces worst, typical;
};

/// Root mean square of the whitened residuals of all channels by cell of phase space; NaN in cells
/// without data.
struct PhaseMap {
  static constexpr std::size_t cells = 24;
  double displacement_m = 0.0;  ///< half width of the map
  double velocity_m_s = 0.0;
  std::vector<double> before, after;  ///< cells * cells, rows of constant velocity
};

/// Drive and residuals of one window of the recording.
struct WindowEvidence {
  double begin_s = 0.0;
  double end_s = 0.0;
  bool reported = false;  ///< of the windows that the scores are of
  double drive_hz = 0.0;
  double drive_amplitude = 0.0;  ///< m, or N of a drive force
  double before = 0.0;           ///< mean square of the whitened residuals of all channels
  double after = 0.0;
};

/// A part of the recording that is shown: up to three neighbouring held-out windows.
struct Stretch {
  std::size_t first = 0;  ///< index into Evidence::windows
  std::size_t count = 0;
  double before = 0.0;  ///< mean square of the whitened residuals of the declared model
};

struct Evidence {
  std::vector<ChannelEvidence> channels;
  PhaseMap map;
  std::vector<WindowEvidence> windows;  ///< in order of time
  Stretch worst;        ///< with the window of the largest residuals of the declared model
  Stretch typical;      ///< with one of median residuals, none shown twice; may be empty
  double median = 0.0;  ///< mean square of the residuals of the median held-out window
  Channel driven_by = Channel::base_displacement;  ///< channel of the drive amplitudes
  bool drive_is_periodic = true;                   ///< it has a frequency, and a phase
  bool drive_noise_removed = false;                ///< the error of the drive was removed
};

/// The stretches to show and the median, from the windows.
void choose_stretches(Evidence& evidence);

/// Of the first experiment of the task. Both hypotheses come with the states of its windows.
Evidence evidence_of(const Task& task, const FittedHypothesis& before,
                     const FittedHypothesis& after);

}  // namespace stickslip::diagnosis
