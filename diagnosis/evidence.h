// What a person looks at to believe a diagnosis: where the residuals were and where they are with
// what was found, and the recording beside both predictions. What the noise of the base's own
// channel can explain of a residual is taken out of it and of the predictions, as it is where
// models are judged.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// Before: the calibrated declared model; after: with all that was found (the same where nothing
/// was).
struct ChannelEvidence {
  Channel channel = Channel::displacement;
  double sigma = 0.0;  ///< noise by which residuals are divided, in the channel's unit
  /// Mean square of the residual over the noise variance, by window of Evidence::windows; NaN where
  /// the channel was not recorded.
  std::vector<double> window_before, window_after;
  /// Mean power of the whitened residual by frequency; 1 is white noise.
  std::vector<double> frequency_hz, power_before, power_after;
  /// Root mean square of the whitened residual by the phase of the drive; NaN where it never was.
  std::vector<double> phase_deg, phase_before, phase_after;
  /// The recording and both predictions over Stretch; a prediction starts anew with every window.
  std::vector<double> time_s, recorded, before, after;
};

/// Root mean square of the whitened residuals of all channels by cell of phase space; NaN where the
/// motion never was.
struct PhaseMap {
  static constexpr std::size_t cells = 24;
  double displacement_m = 0.0;  ///< the map reaches from minus this to this
  double velocity_m_s = 0.0;
  std::vector<double> before, after;  ///< cells * cells, rows of constant velocity
};

/// One window of the recording: how the rig was driven, and how far predictions were off.
struct WindowEvidence {
  double begin_s = 0.0;
  double end_s = 0.0;
  bool held_out = false;
  double drive_hz = 0.0;
  double drive_amplitude = 0.0;  ///< m, or N of a drive force
  double before = 0.0;           ///< mean square of the whitened residuals of all channels
  double after = 0.0;
};

/// The part of the recording that is shown: neighbouring held-out windows, those of them in which
/// the declared model misses most.
struct Stretch {
  std::size_t first = 0;  ///< of Evidence::windows
  std::size_t count = 0;
  double before = 0.0;   ///< mean square there, of the declared model
  double typical = 0.0;  ///< the same of the median held-out window
};

struct Evidence {
  std::vector<ChannelEvidence> channels;
  PhaseMap map;
  std::vector<WindowEvidence> windows;  ///< in the order of time
  Stretch stretch;
  Channel driven_by = Channel::base_displacement;  ///< whose amplitude stands in the windows
  bool base_doubted = false;  ///< whether there was any noise of the base to take out
};

/// A hypothesis with its parameters and the states of the windows of the task.
struct Explanation {
  const Hypothesis* hypothesis = nullptr;
  std::span<const double> z;
  const std::vector<WindowState>* state = nullptr;
};

/// Of the first experiment of the task.
Evidence evidence_of(const Task& task, const Explanation& before, const Explanation& after);

}  // namespace stickslip::diagnosis
