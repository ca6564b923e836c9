// SPDX-License-Identifier: Apache-2.0
// Coloured noise: a share of a channel's noise has a correlation time, the rest is white.
//
// A filter turns residuals into innovations, each divided by its standard deviation: those of the
// true model are white again, so that a slow error counts for what it is worth.
#pragma once

#include <array>

#include "diagnosis/experiment.h"

namespace stickslip::diagnosis {

struct NoiseColour {
  double share = 0.0;          ///< of the variance that is correlated, 0 to 1; 0: white
  double correlation_s = 0.0;  ///< of exp(-t / correlation_s)

  bool is_white() const { return !(share > 0.0); }
  friend bool operator==(const NoiseColour&, const NoiseColour&) = default;
};

/// Of the channels that a model predicts.
using NoiseColours = std::array<NoiseColour, predicted_channels>;

/// The filter of one channel over successive samples of a window: Kalman's for one state. It is
/// linear and depends on times only; derivatives of residuals pass through the same steps.
class Whitening {
 public:
  Whitening() = default;  ///< of white noise
  explicit Whitening(const NoiseColour& colour) : colour_(colour), variance_(colour.share) {}

  /// Coefficients for one sample.
  struct Step {
    double keep = 0.0;   ///< of the correlated part since the last sample
    double gain = 0.0;   ///< of the innovation on the correlated part
    double scale = 1.0;  ///< of the innovation: one over its standard deviation

    /// The innovation of a residual (a number or a row); `slow`, its correlated part, begins at 0.
    template <class Value>
    Value innovation(const Value& residual, Value& slow) const {
      slow *= keep;
      const Value off = residual - slow;
      slow += gain * off;
      return scale * off;
    }
  };
  /// For a sample at that time, after those before it.
  Step next(double time_s);

 private:
  NoiseColour colour_;
  double variance_ = 0.0;  // of the correlated part, before the next sample
  double time_s_ = 0.0;
  double interval_s_ = -1.0;  // that of keep_
  double keep_ = 0.0;
  bool begun_ = false;
};

}  // namespace stickslip::diagnosis
