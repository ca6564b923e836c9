// SPDX-License-Identifier: Apache-2.0
// Calibration: from a device's raw readings to SI values.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "config/calibration.h"
#include "drivers/driver.h"
#include "physics/frame.h"

namespace stickslip::daemon {

/// A frame in SI, with masks of channels (bit i: Channel i).
struct Calibrated {
  Frame frame;
  std::uint8_t not_finite = 0;    ///< NaN or infinite before or after calibration; now invalid
  std::uint8_t uncorrected = 0;   ///< crosstalk from an invalid channel: now invalid
  std::uint8_t out_of_range = 0;  ///< outside the calibrated range; still valid
};

/// Calibration of all channels. The default is the identity.
class Calibration {
 public:
  Calibration() = default;
  /// Inverts the crosstalk: the reading is s = (1 + C) y, so y = (1 + C)^-1 s. The loader has
  /// checked that 1 + C is regular.
  explicit Calibration(const config::ChannelCalibrations& channels);

  /// Every valid channel as (raw - offset) * gain, less its crosstalk; time, sequence and ages are
  /// kept, with the age of the oldest contribution for a corrected channel. Invalid channels stay
  /// invalid with value 0. With offset 0, gain 1 and no crosstalk the value is bit-identical. Does
  /// not allocate.
  Calibrated operator()(const Frame& raw) const;

  /// Standard uncertainty [SI] of a channel's value in an SI frame, from the covariances of offset
  /// and gain of the channel and of those with crosstalk into it; 0 without covariances.
  double sigma(const Frame& si, Channel channel) const;

 private:
  void correct_crosstalk(Calibrated& out) const;

  struct Line {
    double offset = 0.0;
    double gain = 1.0;
    double low = 0.0;  ///< valid range, if there is one
    double high = 0.0;
  };
  using Row = std::array<double, channel_count>;

  std::array<Line, channel_count> lines_{};
  std::array<Row, channel_count> mixing_{};            ///< 1 + C
  std::array<Row, channel_count> unmixing_{};          ///< its inverse, exactly 0 without crosstalk
  std::array<std::uint8_t, channel_count> sources_{};  ///< of crosstalk into it, direct or indirect
  std::uint8_t crosstalk_ = 0;                         ///< channels with crosstalk into them
  std::uint8_t ranged_ = 0;                            ///< channels with a valid range
  std::array<config::LineCovariance, channel_count> covariance_{};
};

inline Calibrated calibrated(const Frame& raw, const Calibration& calibration) {
  return calibration(raw);
}

/// One sentence for each channel that was calibrated in another unit than the device reads in. A
/// channel whose unit is not known on either side is not checked.
std::vector<std::string> unit_disagreements(const config::ChannelCalibrations& channels,
                                            const drivers::Description& device);

}  // namespace stickslip::daemon
