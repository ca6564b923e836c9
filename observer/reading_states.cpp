#include "observer/reading_states.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>

namespace stickslip::observer {

namespace {

// What goes from one section into the next is no straight line over a period: over this part of it.
constexpr int small_steps = 32;

/// A section of a delay, for a step over which its input is a straight line.
class DelaySection {
 public:
  DelaySection(double delay_s, double step_s);

  struct State {
    double value = 0.0;
    double rate = 0.0;
  };
  State step(const State& from, double input_before, double input_after) const {
    return {stay_[0] * from.value + stay_[1] * from.rate + by_before_[0] * input_before +
                by_after_[0] * input_after,
            stay_[2] * from.value + stay_[3] * from.rate + by_before_[1] * input_before +
                by_after_[1] * input_after};
  }

 private:
  std::array<double, 4> stay_{};  // row-major
  std::array<double, 2> by_before_{}, by_after_{};
};

// s^2 + (6 / delay) s + 12 / delay^2 = 0 has the roots -decay +- i turn.
DelaySection::DelaySection(double delay_s, double step_s) {
  const double decay = 3.0 / delay_s;
  const double turn = std::numbers::sqrt3 / delay_s;
  const double fade = std::exp(-decay * step_s);
  const double cosine = fade * std::cos(turn * step_s);
  const double sine = fade * std::sin(turn * step_s);
  stay_ = {cosine + decay / turn * sine, sine / turn, -(decay * decay + turn * turn) / turn * sine,
           cosine - decay / turn * sine};
  // It settles on a straight line half a delay behind it; what it was off that fades.
  const double behind = -0.5 * delay_s;
  const double value_by_slope = (behind - (stay_[0] * behind + stay_[1])) / step_s;
  const double rate_by_slope = (1.0 - (stay_[2] * behind + stay_[3])) / step_s;
  by_after_ = {1.0 + value_by_slope, rate_by_slope};
  by_before_ = {-stay_[0] - value_by_slope, -stay_[2] - rate_by_slope};
}

/// What something is in terms of the states before the period and of a transition's shared sums.
using Weights = std::array<double, padded(max_states) + max_shared_sums>;

double& at(Weights& weights, int index) { return weights[static_cast<std::size_t>(index)]; }

}  // namespace

ReadingStates::ReadingStates(const Layout& layout, double period_s) : layout_(&layout) {
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

void ReadingStates::find_delay(Channel& channel, double period_s) {
  const int sections = channel.chain->delays;
  const double delay_s = channel.chain->delay_s / sections;
  const DelaySection section(delay_s, period_s / small_steps);
  using States = std::array<DelaySection::State, max_delays>;
  // A period on, while what goes in moves from `begin` to `end`.
  const auto pass = [&](States states, double begin, double end) {
    for (int k = 0; k < small_steps; ++k) {
      double before = begin + (end - begin) * k / small_steps;
      double after = begin + (end - begin) * (k + 1) / small_steps;
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
  channel.stay.resize(2 * sections, 2 * sections);
  for (int column = 0; column < 2 * sections; ++column) {
    States unit{};
    DelaySection::State& state = unit[static_cast<std::size_t>(column / 2)];
    (column % 2 == 0 ? state.value : state.rate) = 1.0;
    channel.stay.col(column) = pass(unit, 0.0, 0.0);
  }
  channel.by_before = pass({}, 1.0, 0.0);
  channel.by_after = pass({}, 0.0, 1.0);
}

void ReadingStates::advance(const Vector& before, Vector& after, Transition& transition) const {
  if (channels_.empty()) return;
  transition.clear_from(layout_->behind_chains);
  for (const Channel& channel : channels_) {
    if (channel.chain->delays > 0) delay(channel, before, after, transition);
    if (channel.chain->hum >= 0) hum(channel, before, after, transition);
    if (const int offset = channel.chain->offset; offset >= 0) {
      after[offset] = before[offset];
      transition.begin_row();
      transition.add(offset, 1.0);
    }
  }
}

void ReadingStates::delay(const Channel& channel, const Vector& before, Vector& after,
                          Transition& transition) {
  const int input = channel.chain->reading;
  const int first = channel.chain->first_delay;
  const int count = 2 * channel.chain->delays;
  after.segment(first, count).noalias() = channel.stay.lazyProduct(before.segment(first, count));
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
    for (int j = 0; j < count; ++j) at(row, first + j) += channel.stay(i, j);
    transition.begin_row();
    for (std::size_t j = 0; j < row.size(); ++j) {
      if (row[j] != 0.0) transition.add(static_cast<int>(j), row[j]);
    }
  }
}

void ReadingStates::hum(const Channel& channel, const Vector& before, Vector& after,
                        Transition& transition) {
  const int now = channel.chain->hum;
  const int quarter_before = now + 1;
  after[now] = channel.cosine * before[now] - channel.sine * before[quarter_before];
  after[quarter_before] = channel.sine * before[now] + channel.cosine * before[quarter_before];
  transition.begin_row();
  transition.add(now, channel.cosine);
  transition.add(quarter_before, -channel.sine);
  transition.begin_row();
  transition.add(now, channel.sine);
  transition.add(quarter_before, channel.cosine);
}

}  // namespace stickslip::observer
