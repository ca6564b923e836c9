// Readings that depart from what their declared chain delivers: gains, leaks, drifts, hum, delays,
// limits and a differentiator that rolls off early. One law for all channels (ReadingLaw); an
// effect of the catalogue sets its numbers.
#pragma once

#include <vector>

#include "physics/effects/effect.h"
#include "physics/sensor_chain.h"

namespace stickslip::physics {

/// What the faults remember beside the chains.
template <class T>
struct FaultMemory {
  T rolled_off{0.0};  ///< output of the actual differentiator
  T into_differentiator{0.0};
  std::vector<Readings<T>> past;  ///< a ring of the latest readings, one for each step
  std::size_t latest = 0;
};

/// What a channel delivers instead of `value`, but for its delay and what leaks into it.
template <class T>
T misread(const ReadingLaw<T>& law, const T& value, double time_s);

/// The longest delay that is remembered [s].
inline constexpr double longest_delay_s = 0.03;

/// The faults of one rig at one step length. Immutable; `bank` must outlive it.
template <class T>
class ReadingFaults {
 public:
  ReadingFaults(const ReadingLaws<T>& laws, const SensorBank& bank, double step_s);

  /// The memory of faults over chains that have settled. Allocates where there are delays.
  void settle(FaultMemory<T>& memory, const SensorMemory<T>& chains) const;
  /// One step on, after the chains.
  void advance(FaultMemory<T>& memory, const SensorMemory<T>& chains) const;
  /// What is read at `time_s`.
  Readings<T> readings(const FaultMemory<T>& memory, const SensorMemory<T>& chains,
                       double time_s) const;

 private:
  Readings<T> undisturbed(const FaultMemory<T>& memory, const SensorMemory<T>& chains) const;
  T ago(const FaultMemory<T>& memory, const T& delay_s, Channel channel) const;

  ReadingLaws<T> laws_;
  const SensorBank* bank_;
  double step_s_;
  bool rolls_off_ = false;
  T stay_{0.0}, before_{0.0}, after_{0.0};  ///< the roll-off's step
};

}  // namespace stickslip::physics
