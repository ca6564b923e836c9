// What stands between a chain's output and its reading, as far as it has states: pure delays, hum
// and a zero that wanders. They follow the chains, period by period.
//
// A delay is a row of sections that pass all frequencies and turn their phases, the second-order
// Pade approximants of exp(-s delay). Each has two states, a low-pass of its input and that one's
// rate; what comes out is its input less delay times the rate.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "observer/layout.h"
#include "observer/transition.h"

namespace stickslip::observer {

/// Hum is another one after this time.
inline constexpr double hum_memory_s = 10.0;

class ReadingStates {
 public:
  /// `layout` must outlive it.
  ReadingStates(const Layout& layout, double period_s);

  /// One period on: `after` and `transition` hold what the chains have become, and get the rest.
  /// What goes into a delay is taken as a straight line over the period.
  void advance(const Vector& before, Vector& after, Transition& transition) const;

 private:
  static constexpr int most = 2 * max_delays;
  struct Channel {
    const Chain* chain = nullptr;
    // The states of the delay by themselves, and of its input at both ends of a period.
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, most, most> stay;
    Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, most, 1> by_before, by_after;
    double cosine = 1.0, sine = 0.0;  ///< by which the hum turns, as far as it stays the same
  };
  static void find_delay(Channel& channel, double period_s);
  static void delay(const Channel& channel, const Vector& before, Vector& after,
                    Transition& transition);
  static void hum(const Channel& channel, const Vector& before, Vector& after,
                  Transition& transition);

  const Layout* layout_;
  std::vector<Channel> channels_;  ///< those that have such states, in their order
};

}  // namespace stickslip::observer
