// SPDX-License-Identifier: Apache-2.0
// A simulated rig whose model changes during a run, with continuous state and sensor chains.
// RigSimulator does not support that.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <optional>
#include <random>

#include "physics/model.h"
#include "physics/rig.h"
#include "physics/sensor_chain.h"
#include "physics/simulator.h"

namespace stickslip::observer::test {

/// A base-excited rig, with or without load cell; its terms must not concern sensors.
class ChangingRig {
 public:
  ChangingRig(const physics::Model& model, double step_s, std::uint64_t seed)
      : model_(model),
        step_s_(step_s),
        rig_(model),
        numbers_(rig_.numbers<double>(rig_.parameter_values())),
        bank_(model, step_s),
        base_(model.sensors[index_of(Channel::base_displacement)].filters, step_s),
        random_(seed) {
    rig_.complete(state_, now_, 0.0, numbers_);
    bank_.settle(sensors_, rig_.quantities(state_, now_, numbers_));
    base_.settle(base_memory_, 0.0, 0.0);
  }

  /// Changes to another model with the same sensor chains. A bristle starts with the deflection
  /// that gives the current friction force.
  void become(const physics::Model& model) {
    const bool was_bristle = rig_.structure().kinetics == physics::Kinetics::bristle;
    model_ = model;
    rig_ = physics::Rig(model);
    numbers_ = rig_.numbers<double>(rig_.parameter_values());
    if (!was_bristle && rig_.structure().kinetics == physics::Kinetics::bristle) {
      state_.s[physics::state::contact] = state_.friction / numbers_.c.contact_stiffness;
    }
  }

  /// Delays a channel by `frames` frames from now on.
  void delay(Channel channel, int frames) {
    late_ = channel;
    late_frames_ = frames;
  }

  /// Advances by one step; `end`: input at its end.
  void step(const physics::Input& end) {
    rig_.step(state_, now_, end, time_s_, step_s_, numbers_);
    now_ = end;
    time_s_ += step_s_;
    bank_.advance(sensors_, rig_.quantities(state_, now_, numbers_));
    base_.advance(base_memory_, end.base_displacement_m, 0.0);
  }

  Frame read() {
    const physics::Readings<double> readings = bank_.readings(sensors_);
    std::array<double, channel_count> now{};
    now[index_of(Channel::displacement)] = readings.displacement;
    now[index_of(Channel::velocity)] = readings.velocity;
    now[index_of(Channel::friction_force)] = readings.friction_force;
    now[index_of(Channel::normal_load)] = readings.normal_load;
    now[index_of(Channel::base_displacement)] = base_.output(base_memory_);
    past_.push_front(now);
    if (past_.size() > 64) past_.pop_back();
    Frame frame;
    frame.time_ns = std::llround(time_s_ * 1.0e9);
    frame.sequence = sequence_++;
    for (const Channel channel : {Channel::displacement, Channel::velocity, Channel::friction_force,
                                  Channel::normal_load, Channel::base_displacement}) {
      const std::size_t ago = late_ == channel ? static_cast<std::size_t>(late_frames_) : 0;
      const double value = past_[std::min(ago, past_.size() - 1)][index_of(channel)];
      const auto& noise = model_.sensors[index_of(channel)].noise_std;
      const double disturbance = noise ? *noise * normal_(random_) : 0.0;
      if (channel == Channel::friction_force && !rig_.structure().friction) continue;
      if (channel == Channel::normal_load && !rig_.structure().loaded) continue;
      frame.set(channel, value + disturbance);
    }
    return frame;
  }

  double time_s() const { return time_s_; }

 private:
  physics::Model model_;
  double step_s_;
  physics::Rig rig_;
  physics::RigNumbers<double> numbers_;
  physics::SensorBank bank_;
  physics::FilterChain base_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  physics::RigState<double> state_;
  physics::Input now_;
  physics::SensorMemory<double> sensors_;
  physics::FilterMemory<double> base_memory_;
  std::deque<std::array<double, channel_count>> past_;
  std::optional<Channel> late_;
  int late_frames_ = 0;
  double time_s_ = 0.0;
  std::uint64_t sequence_ = 0;
};

}  // namespace stickslip::observer::test
