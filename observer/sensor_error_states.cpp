// SPDX-License-Identifier: Apache-2.0
#include "observer/sensor_error_states.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>

namespace stickslip::observer {

namespace {

// Substeps of a period, over which the signal between two sections is taken as linear.
constexpr int substeps = 32;

/// A section of a delay, for a step over which its input is linear.
class DelaySection {
 public:
  DelaySection(double delay_s, double step_s);

  struct State {
    double value = 0.0;
    double rate = 0.0;
  };
  State step(const State& from, double input_before, double input_after) const {
    return {transition_[0] * from.value + transition_[1] * from.rate +
                by_before_[0] * input_before + by_after_[0] * input_after,
            transition_[2] * from.value + transition_[3] * from.rate +
                by_before_[1] * input_before + by_after_[1] * input_after};
  }

 private:
  std::array<double, 4> transition_{};  // row-major
  std::array<double, 2> by_before_{}, by_after_{};
};

// s^2 + (6 / delay) s + 12 / delay^2 = 0 has the roots -decay +- i omega.
DelaySection::DelaySection(double delay_s, double step_s) {
  const double decay = 3.0 / delay_s;
  const double omega = std::numbers::sqrt3 / delay_s;
  const double envelope = std::exp(-decay * step_s);
  const double cosine = envelope * std::cos(omega * step_s);
  const double sine = envelope * std::sin(omega * step_s);
  transition_ = {cosine + decay / omega * sine, sine / omega,
                 -(decay * decay + omega * omega) / omega * sine, cosine - decay / omega * sine};
  // The response to a ramp is a ramp half a delay later; the deviation from it decays.
  const double behind = -0.5 * delay_s;
  const double value_by_slope = (behind - (transition_[0] * behind + transition_[1])) / step_s;
  const double rate_by_slope = (1.0 - (transition_[2] * behind + transition_[3])) / step_s;
  by_after_ = {1.0 + value_by_slope, rate_by_slope};
  by_before_ = {-transition_[0] - value_by_slope, -transition_[2] - rate_by_slope};
}

/// A row of weights on the states before the period and on a transition's shared sums.
using Weights = std::array<double, padded(max_states) + max_shared_sums>;

double& at(Weights& weights, int index) { return weights[static_cast<std::size_t>(index)]; }

}  // namespace

SensorErrorStates::SensorErrorStates(const Layout& layout, double period_s) : layout_(&layout) {
  for (const Chain& chain : layout.chain) {
    if (chain.delays == 0 && chain.hum < 0 && chain.offset < 0) continue;
    Channel channel;
    channel.chain = &chain;
    if (chain.delays > 0) find_delay(channel, period_s);
    const double kept = std::exp(-period_s / hum_memory_s);
    channel.cosine = kept * std::cos(chain.hum_rad_s * period_s);
    channel.sine = kept * std::sin(chain.hum_rad_s * period_s);
    channels_.push_back(channel);
  }
}

void SensorErrorStates::find_delay(Channel& channel, double period_s) {
  const int sections = channel.chain->delays;
  const double delay_s = channel.chain->delay_s / sections;
  const DelaySection section(delay_s, period_s / substeps);
  using States = std::array<DelaySection::State, max_delays>;
  // The states after a period in which the input moves from `begin` to `end`.
  const auto after_period = [&](States states, double begin, double end) {
    for (int k = 0; k < substeps; ++k) {
      double before = begin + (end - begin) * k / substeps;
      double after = begin + (end - begin) * (k + 1) / substeps;
      for (DelaySection::State& state :
           std::span(states).first(static_cast<std::size_t>(sections))) {
        const DelaySection::State next = section.step(state, before, after);
        before -= delay_s * state.rate;
        after -= delay_s * next.rate;
        state = next;
      }
    }
    Vector out(2 * sections);
    for (int k = 0; k < sections; ++k) {
      out[2 * k] = states[static_cast<std::size_t>(k)].value;
      out[2 * k + 1] = states[static_cast<std::size_t>(k)].rate;
    }
    return out;
  };
  channel.delay_transition.resize(2 * sections, 2 * sections);
  for (int column = 0; column < 2 * sections; ++column) {
    States unit{};
    DelaySection::State& state = unit[static_cast<std::size_t>(column / 2)];
    (column % 2 == 0 ? state.value : state.rate) = 1.0;
    channel.delay_transition.col(column) = after_period(unit, 0.0, 0.0);
  }
  channel.by_before = after_period({}, 1.0, 0.0);
  channel.by_after = after_period({}, 0.0, 1.0);
}

void SensorErrorStates::advance(const Vector& before, Vector& after, Transition& transition) const {
  if (channels_.empty()) return;
  transition.clear_from(layout_->first_sensor_error);
  for (const Channel& channel : channels_) {
    if (channel.chain->delays > 0) advance_delay(channel, before, after, transition);
    if (channel.chain->hum >= 0) advance_hum(channel, before, after, transition);
    if (const int offset = channel.chain->offset; offset >= 0) {
      after[offset] = before[offset];
      transition.begin_row();
      transition.add(offset, 1.0);
    }
  }
}

void SensorErrorStates::advance_delay(const Channel& channel, const Vector& before, Vector& after,
                                      Transition& transition) {
  const int input = channel.chain->reading;
  const int first = channel.chain->first_delay;
  const int count = 2 * channel.chain->delays;
  after.segment(first, count).noalias() =
      channel.delay_transition.lazyProduct(before.segment(first, count));
  after.segment(first, count) +=
      channel.by_before * before[input] + channel.by_after * after[input];
  Weights input_after{};
  for (auto* entry = transition.row_begin(input); entry != transition.row_end(input); ++entry) {
    input_after[entry->from] += entry->weight;
  }
  for (int i = 0; i < count; ++i) {
    Weights row{};
    for (std::size_t j = 0; j < row.size(); ++j) row[j] = channel.by_after[i] * input_after[j];
    at(row, input) += channel.by_before[i];
    for (int j = 0; j < count; ++j) at(row, first + j) += channel.delay_transition(i, j);
    transition.begin_row();
    for (std::size_t j = 0; j < row.size(); ++j) {
      if (row[j] != 0.0) transition.add(static_cast<int>(j), row[j]);
    }
  }
}

void SensorErrorStates::advance_hum(const Channel& channel, const Vector& before, Vector& after,
                                    Transition& transition) {
  const int now = channel.chain->hum;
  const int quarter_earlier = now + 1;
  after[now] = channel.cosine * before[now] - channel.sine * before[quarter_earlier];
  after[quarter_earlier] = channel.sine * before[now] + channel.cosine * before[quarter_earlier];
  transition.begin_row();
  transition.add(now, channel.cosine);
  transition.add(quarter_earlier, -channel.sine);
  transition.begin_row();
  transition.add(now, channel.sine);
  transition.add(quarter_earlier, channel.cosine);
}

}  // namespace stickslip::observer
