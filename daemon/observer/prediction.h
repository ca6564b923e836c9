// One period of the filter's model: where its states go, and the derivatives of that.
#pragma once

#include <array>

#include "daemon/observer/layout.h"
#include "physics/rig.h"
#include "physics/sensor_chain.h"

namespace stickslip::observer {

/// The derivatives of one period: core' = f(core), tail' = g(core) + memory tail.
struct Transition {
  Matrix core;    ///< d core' / d core
  Matrix tail;    ///< d tail' / d core; row 0 is the first tail state
  Matrix memory;  ///< d tail' / d tail; constant, zero outside Layout::runs
};

class Prediction {
 public:
  /// `steps`: integration steps in a period. `rig` and `layout` must outlive this.
  Prediction(const physics::Rig& rig, const physics::Model& model, const Layout& layout,
             double period_s, int steps);

  /// Moves `mean` on by one period from `time_s` and renews transition(). The backbone g is taken
  /// as its mean over a Gaussian doubt of the slip velocity of `slip_variance` [(m/s)^2].
  void advance(Vector& mean, double time_s, double slip_variance);

  const Transition& transition() const { return transition_; }

  /// The plain numbers of the model's equations.
  const physics::RigNumbers<double>& numbers() const { return numbers_; }

 private:
  void fill_memory_transition();
  template <class T>
  void recall(physics::FilterMemory<T>& memory, Channel channel, const Vector& states,
              const T& input, const T& input_rate) const;
  void pass(const Vector& mean, double time_s, int offset);
  physics::Dual seed(const Vector& mean, int index, int offset) const;

  const physics::Rig* rig_;
  const Layout* layout_;
  double period_s_;
  int steps_;
  bool loaded_by_measurement_;
  bool quasi_static_;
  std::array<physics::FilterChain, channel_count> chains_;
  physics::RigNumbers<double> numbers_;
  physics::RigNumbers<physics::Dual> dual_numbers_;
  Transition transition_;
  Vector next_;
};

}  // namespace stickslip::observer
