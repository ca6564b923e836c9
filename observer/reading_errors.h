// SPDX-License-Identifier: Apache-2.0
// Errors of readings for an error of one standard deviation of each parameter of the sensor errors
// that a model's [[physics]] terms describe.
#pragma once

#include <array>
#include <vector>

#include "observer/layout.h"
#include "physics/effect.h"
#include "physics/frame.h"

namespace stickslip::observer {

class ReadingErrors {
 public:
  /// `shifted`: the laws with one parameter higher by its standard deviation, one for each.
  /// `layout` must outlive it.
  ReadingErrors(const physics::ReadingLaws<double>& laws,
                std::vector<physics::ReadingLaws<double>> shifted, const Layout& layout,
                double period_s);

  int count() const { return static_cast<int>(shifted_.size()); }

  /// The readings of a frame before their correction.
  void read(const Frame& raw);

  /// Error of a corrected reading with respect to parameter `i`, in units of the channel.
  double of(int i, Channel channel, const Vector& mean) const;

  /// States that parameters act on: the output of the velocity's differentiator, and hum.
  const std::vector<int>& rows() const { return rows_; }
  /// Changes of rows() over a period for parameter `i`; valid until the next call.
  const std::vector<double>& changes(int i, const Vector& mean);

 private:
  double cutoff_change(int i, const Vector& mean) const;
  double value(Channel channel, const Vector& mean) const;
  double rate(Channel channel, const Vector& mean) const;

  physics::ReadingLaws<double> laws_;
  std::vector<physics::ReadingLaws<double>> shifted_;
  const Layout* layout_;
  double period_s_;
  /// Measurement rows of a channel, and for an age from which its rate is found.
  std::array<MeasurementRow, channel_count> now_, earlier_;
  using PerChannel = std::array<double, channel_count>;
  std::vector<int> rows_;
  std::vector<double> changes_;
  std::vector<PerChannel> inversion_;  ///< by parameter: of gain, curvature and characteristic
};

}  // namespace stickslip::observer
