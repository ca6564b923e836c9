// SPDX-License-Identifier: Apache-2.0
// Filter states between a chain's output and its reading: pure delay, hum and drifting offset. They
// are propagated after the chains.
//
// A delay is a cascade of second-order Pade approximants of exp(-s delay), which are all-passes.
// Each has two states, a low-pass of its input and its rate; the output is the input minus delay
// times the rate.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "observer/layout.h"
#include "observer/transition.h"

namespace stickslip::observer {

/// Correlation time of the hum's amplitude and phase.
inline constexpr double hum_memory_s = 10.0;

class SensorErrorStates {
 public:
  /// `layout` must outlive it.
  SensorErrorStates(const Layout& layout, double period_s);

  /// Time update by one period: `after` and `transition` hold the rows of the chains and are
  /// completed. The input of a delay is interpolated linearly over the period.
  void advance(const Vector& before, Vector& after, Transition& transition) const;

 private:
  static constexpr int most = 2 * max_delays;
  struct Channel {
    const Chain* chain = nullptr;
    // State transition of the delay, and its response to the input at both ends of a period.
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, most, most>
        delay_transition;
    Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, most, 1> by_before, by_after;
    double cosine = 1.0, sine = 0.0;  ///< damped rotation of the hum over a period
  };
  static void find_delay(Channel& channel, double period_s);
  static void advance_delay(const Channel& channel, const Vector& before, Vector& after,
                            Transition& transition);
  static void advance_hum(const Channel& channel, const Vector& before, Vector& after,
                          Transition& transition);

  const Layout* layout_;
  std::vector<Channel> channels_;  ///< those with such states, in order
};

}  // namespace stickslip::observer
