// From what a device says to what a channel measures.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "config/calibration.h"
#include "drivers/driver.h"
#include "physics/frame.h"

namespace stickslip::daemon {

/// A frame in SI, and what has to be said about it. Bit i of each mask stands for channel i.
struct Calibrated {
  Frame frame;
  std::uint8_t not_finite = 0;    ///< was NaN or infinite, before or after, and is now invalid
  std::uint8_t uncorrected = 0;   ///< a channel that leaks into it was not there: now invalid
  std::uint8_t out_of_range = 0;  ///< lies where the calibration was not looked at; still valid
};

/// The calibration of all channels, prepared for one pass over a frame. The default is the
/// identity.
class Calibration {
 public:
  Calibration() = default;
  /// Solves for the cross-talk once: what is read is s = (1 + C) y, so y = (1 + C)^-1 s. The
  /// determinant of 1 + C is not 0 (the loader sees to it).
  explicit Calibration(const config::ChannelCalibrations& channels);

  /// Every valid channel as (raw - offset) * gain less what leaks into it; time, sequence and ages
  /// are kept, the age of a corrected channel being that of the oldest value in it. A channel that
  /// was invalid stays so with value 0. With offset 0, gain 1 and no cross-talk the value is the
  /// same to the bit. Allocates nothing.
  Calibrated operator()(const Frame& raw) const;

  /// Standard uncertainty of a channel's value in an SI frame by the covariances of offset and
  /// gain, its own and those of the channels that leak into it, SI; 0 where no covariance was told.
  double sigma(const Frame& si, Channel channel) const;

 private:
  void take_off_leaks(Calibrated& out) const;

  struct Line {
    double offset = 0.0;
    double gain = 1.0;
    double low = 0.0;  ///< of the valid range, where there is one
    double high = 0.0;
  };
  using Row = std::array<double, channel_count>;

  std::array<Line, channel_count> lines_{};
  std::array<Row, channel_count> mixing_{};    ///< 1 + C
  std::array<Row, channel_count> unmixing_{};  ///< its inverse, exactly 0 where nothing leaks
  std::array<std::uint8_t, channel_count>
      needs_{};              ///< channels that leak into it, through others too
  std::uint8_t leaky_ = 0;   ///< channels into which something leaks
  std::uint8_t ranged_ = 0;  ///< channels with a valid range
  std::array<config::LineCovariance, channel_count> covariance_{};
};

/// The raw frame in SI.
inline Calibrated calibrated(const Frame& raw, const Calibration& calibration) {
  return calibration(raw);
}

/// One sentence for each channel whose calibration was made in another unit than the one that the
/// device reads in; empty where they agree or one of them does not say.
std::vector<std::string> unit_disagreements(const config::ChannelCalibrations& channels,
                                            const drivers::Description& device);

}  // namespace stickslip::daemon
