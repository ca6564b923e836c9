// What a person looks at to believe a diagnosis: where the residuals were and where they are with
// what was found, the recording beside both predictions, and the laws that were fitted.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "physics/effects/effect.h"
#include "tools/diagnose/shooting.h"

namespace stickslip::diagnosis {

/// A quantity of the fitted physics over one variable.
struct Curve {
  std::string variable;  ///< "displacement"
  std::string variable_unit;
  std::string quantity;  ///< "force on the mass"
  std::string unit;
  std::vector<double> at;
  std::vector<double> value;
};

/// How an effect with these parameters (in the order of its card) depends on what it acts on, over
/// the range of a recording. Empty for what is no function of one variable: faults of sensors,
/// hidden states.
std::vector<Curve> shape_of(const physics::Effect& effect, std::span<const double> parameters,
                            const Experiment& experiment);

/// Before: the calibrated declared model; after: with all that was found (the same where nothing
/// was).
struct ChannelEvidence {
  Channel channel = Channel::displacement;
  /// Mean square of the residual over the noise variance, by window.
  std::vector<double> window_time_s, window_before, window_after;
  /// Mean power of the whitened residual by frequency; 1 is white noise.
  std::vector<double> frequency_hz, power_before, power_after;
  /// The recording and both predictions where the declared model fails most; a prediction starts
  /// anew with every window.
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

struct Evidence {
  std::vector<ChannelEvidence> channels;
  PhaseMap map;
  std::vector<double> window_begin_s;  ///< of the stretch that is shown
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
