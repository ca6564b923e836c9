#include "daemon/observer/reading_states.h"

#include <cmath>
#include <cstddef>
#include <numbers>

namespace stickslip::observer {

namespace {

/// What something is in terms of the states before the period and of a transition's shared sums.
using Weights = std::array<double, padded(max_states) + max_shared_sums>;

double& at(Weights& weights, int index) { return weights[static_cast<std::size_t>(index)]; }

void add_row(Weights& to, double weight, const Transition& transition, int state) {
  for (auto* entry = transition.row_begin(state); entry != transition.row_end(state); ++entry) {
    to[entry->from] += weight * entry->weight;
  }
}

}  // namespace

ReadingStates::ReadingStates(const Layout& layout, double period_s) : layout_(&layout) {
  for (const Chain& chain : layout.chain) {
    if (chain.delays == 0 && chain.hum < 0 && chain.offset < 0) continue;
    Channel channel{.chain = &chain, .section = {}};
    if (chain.delays > 0) channel.section = section_of(chain.delay_s / chain.delays, period_s);
    channel.cosine = std::cos(chain.hum_rad_s * period_s);
    channel.sine = std::sin(chain.hum_rad_s * period_s);
    channels_.push_back(channel);
  }
}

// s^2 + (6 / delay) s + 12 / delay^2 = 0 has the roots -decay +- i turn.
ReadingStates::Section ReadingStates::section_of(double delay_s, double period_s) {
  Section section{.delay_s = delay_s};
  const double decay = 3.0 / delay_s;
  const double turn = std::numbers::sqrt3 / delay_s;
  const double fade = std::exp(-decay * period_s);
  const double cosine = fade * std::cos(turn * period_s);
  const double sine = fade * std::sin(turn * period_s);
  const auto& stay =
      section.stay = {cosine + decay / turn * sine, sine / turn,
                      -(decay * decay + turn * turn) / turn * sine, cosine - decay / turn * sine};
  // It settles on a straight line half a delay behind it; what it was off that fades.
  const double behind = -0.5 * delay_s;
  const double value_by_slope = (behind - (stay[0] * behind + stay[1])) / period_s;
  const double rate_by_slope = (1.0 - (stay[2] * behind + stay[3])) / period_s;
  section.by_after = {1.0 + value_by_slope, rate_by_slope};
  section.by_before = {-stay[0] - value_by_slope, -stay[2] - rate_by_slope};
  return section;
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
  const Chain& chain = *channel.chain;
  const Section& section = channel.section;
  double input_before = before[chain.reading];
  double input_after = after[chain.reading];
  Weights seen_before{};
  Weights seen_after{};
  at(seen_before, chain.reading) = 1.0;
  add_row(seen_after, 1.0, transition, chain.reading);
  for (int k = 0; k < chain.delays; ++k) {
    const int value = chain.first_delay + 2 * k;
    const int rate = value + 1;
    for (std::size_t i = 0; i < 2; ++i) {
      const double by_value = section.stay[2 * i];
      const double by_rate = section.stay[2 * i + 1];
      after[value + static_cast<int>(i)] = by_value * before[value] + by_rate * before[rate] +
                                           section.by_before[i] * input_before +
                                           section.by_after[i] * input_after;
      Weights row{};
      at(row, value) = by_value;
      at(row, rate) = by_rate;
      for (std::size_t j = 0; j < row.size(); ++j) {
        row[j] += section.by_before[i] * seen_before[j] + section.by_after[i] * seen_after[j];
      }
      transition.begin_row();
      for (std::size_t j = 0; j < row.size(); ++j) {
        if (row[j] != 0.0) transition.add(static_cast<int>(j), row[j]);
      }
    }
    // What the next section gets.
    input_before -= section.delay_s * before[rate];
    input_after -= section.delay_s * after[rate];
    at(seen_before, rate) -= section.delay_s;
    add_row(seen_after, -section.delay_s, transition, rate);
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
