// SPDX-License-Identifier: Apache-2.0
// Readings of the channels over a run.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "physics/frame.h"

namespace stickslip::commissioning {

/// Mean and standard deviation of the readings of a channel, each counted once however often a
/// frame holds it.
class Readings {
 public:
  /// A valid reading [raw], measured at that time.
  void add(double value, std::int64_t time_ns) {
    constexpr std::int64_t resolution_ns = 2'000;  // of ages
    if (count_ > 0 && std::abs(time_ns - last_ns_) <= resolution_ns) return;
    last_ns_ = time_ns;
    ++count_;
    const double step = value - mean_;
    mean_ += step / static_cast<double>(count_);
    squares_ += step * (value - mean_);
  }
  std::size_t count() const { return count_; }
  double mean() const { return mean_; }
  double deviation() const {
    return count_ < 2 ? 0.0 : std::sqrt(squares_ / static_cast<double>(count_ - 1));
  }
  /// Standard uncertainty of the mean, of independent readings.
  double mean_sigma() const {
    return count_ == 0 ? 0.0 : deviation() / std::sqrt(static_cast<double>(count_));
  }

 private:
  std::size_t count_ = 0;
  double mean_ = 0.0;
  double squares_ = 0.0;
  std::int64_t last_ns_ = 0;
};

using ChannelReadings = std::array<Readings, channel_count>;

/// Time of a channel's measurement in a frame [ns].
inline std::int64_t measured_ns(const Frame& frame, Channel channel) {
  return frame.time_ns - std::int64_t{1000} * frame.age_us[index_of(channel)];
}

inline void add(ChannelReadings& readings, const Frame& frame) {
  for (const Channel channel : all_channels) {
    if (!frame.has(channel)) continue;
    readings[index_of(channel)].add(frame[channel], measured_ns(frame, channel));
  }
}

}  // namespace stickslip::commissioning
