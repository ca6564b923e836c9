// What stands between a chain's output and its reading, as far as it has states: pure delays, hum
// and a zero that wanders. They follow the chains, period by period.
//
// A delay is a row of sections that pass all frequencies and turn their phases, the second-order
// Pade approximants of exp(-s delay). Each has two states, a low-pass of its input and that one's
// rate; what comes out is its input less delay times the rate.
#pragma once

#include <array>
#include <vector>

#include "daemon/observer/layout.h"
#include "daemon/observer/transition.h"

namespace stickslip::observer {

class ReadingStates {
 public:
  /// `layout` must outlive it.
  ReadingStates(const Layout& layout, double period_s);

  /// One period on: `after` and `transition` hold what the chains have become, and get the rest.
  /// What goes into a delay is taken as a straight line over the period.
  void advance(const Vector& before, Vector& after, Transition& transition) const;

 private:
  /// A section of a channel's delay; all of them are alike.
  struct Section {
    double delay_s = 0.0;
    std::array<double, 4> stay{};                   ///< row-major: value and rate by themselves
    std::array<double, 2> by_before{}, by_after{};  ///< of the input at both ends
  };
  struct Channel {
    const Chain* chain = nullptr;
    Section section;
    double cosine = 1.0, sine = 0.0;  ///< by which the hum turns
  };
  static Section section_of(double delay_s, double period_s);
  static void delay(const Channel& channel, const Vector& before, Vector& after,
                    Transition& transition);
  static void hum(const Channel& channel, const Vector& before, Vector& after,
                  Transition& transition);

  const Layout* layout_;
  std::vector<Channel> channels_;  ///< those that have such states, in their order
};

}  // namespace stickslip::observer
