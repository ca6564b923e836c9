// SPDX-License-Identifier: Apache-2.0
#include "observer/reading_errors.h"

#include <numbers>
#include <utility>

#include "physics/reading.h"

namespace stickslip::observer {

namespace {

// Over which the rate of a reading is taken.
constexpr double rate_step_s = 1.0e-3;

}  // namespace

ReadingErrors::ReadingErrors(const physics::ReadingLaws<double>& laws,
                             std::vector<physics::ReadingLaws<double>> shifted,
                             const Layout& layout, double period_s)
    : laws_(laws),
      shifted_(std::move(shifted)),
      layout_(&layout),
      period_s_(period_s),
      inversion_(shifted_.size()) {
  for (PerChannel& each : inversion_) each.fill(0.0);
  if (shifted_.empty()) return;
  for (Channel channel : all_channels) {
    if (!layout.of(channel).used) continue;
    now_[index_of(channel)] = measurement_row(layout, channel, 0.0);
    earlier_[index_of(channel)] = measurement_row(layout, channel, rate_step_s);
  }
  if (layout.of(Channel::velocity).used) rows_.push_back(layout.of(Channel::velocity).reading);
  for (const Chain& chain : layout.chain) {
    if (chain.hum >= 0) rows_.insert(rows_.end(), {chain.hum, chain.hum + 1});
  }
}

void ReadingErrors::read(const Frame& raw) {
  for (Channel channel : all_channels) {
    const std::size_t c = index_of(channel);
    if (shifted_.empty() || !raw.has(channel) || !layout_->of(channel).used) continue;
    const auto assumed = physics::correct_reading(laws_.of[c], raw[channel]);
    for (std::size_t i = 0; i < shifted_.size(); ++i) {
      const auto possible = physics::correct_reading(shifted_[i].of[c], raw[channel]);
      inversion_[i][c] = assumed && possible ? assumed->value - possible->value : 0.0;
    }
  }
}

double ReadingErrors::value(Channel channel, const Vector& mean) const {
  const MeasurementRow& row = now_[index_of(channel)];
  return row.product(mean, row.count);
}

double ReadingErrors::rate(Channel channel, const Vector& mean) const {
  const MeasurementRow& now = now_[index_of(channel)];
  const MeasurementRow& earlier = earlier_[index_of(channel)];
  return (now.product(mean, now.dynamic_terms) - earlier.product(mean, earlier.dynamic_terms)) /
         rate_step_s;
}

double ReadingErrors::of(int i, Channel channel, const Vector& mean) const {
  const std::size_t c = index_of(channel);
  const auto& shifted = shifted_[static_cast<std::size_t>(i)].of[c];
  const auto& assumed = laws_.of[c];
  double error = inversion_[static_cast<std::size_t>(i)][c];
  const double later_s = shifted.delay_s - assumed.delay_s;
  if (later_s != 0.0) error -= later_s * rate(channel, mean);
  const double more = shifted.crosstalk - assumed.crosstalk;
  if (more != 0.0 && assumed.crosstalk_from && layout_->of(*assumed.crosstalk_from).used) {
    error += more * value(*assumed.crosstalk_from, mean);
  }
  return error;
}

// Of the first-order section that the cut-off belongs to, the last of its chain.
double ReadingErrors::cutoff_change(int i, const Vector& mean) const {
  const double assumed_hz = laws_.velocity_cutoff_hz;
  const double higher_hz = shifted_[static_cast<std::size_t>(i)].velocity_cutoff_hz - assumed_hz;
  if (higher_hz == 0.0 || !(assumed_hz > 0.0)) return 0.0;
  return period_s_ * higher_hz / assumed_hz * rate(Channel::velocity, mean);
}

const std::vector<double>& ReadingErrors::changes(int i, const Vector& mean) {
  changes_.clear();
  if (layout_->of(Channel::velocity).used) changes_.push_back(cutoff_change(i, mean));
  for (Channel channel : all_channels) {
    const Chain& chain = layout_->of(channel);
    if (chain.hum < 0) continue;
    const std::size_t c = index_of(channel);
    const double more_hz =
        shifted_[static_cast<std::size_t>(i)].of[c].hum_frequency_hz - laws_.of[c].hum_frequency_hz;
    const double angle = 2.0 * std::numbers::pi * more_hz * period_s_;
    changes_.insert(changes_.end(), {-angle * mean[chain.hum + 1], angle * mean[chain.hum]});
  }
  return changes_;
}

}  // namespace stickslip::observer
