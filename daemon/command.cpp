// SPDX-License-Identifier: Apache-2.0
#include "daemon/command.h"

#include <algorithm>
#include <cmath>

namespace stickslip::daemon {

void Averaging::Moments::add(double value) {
  const double deviation = value - mean;
  mean += deviation / static_cast<double>(++count);
  squares += deviation * (value - mean);
}

double Averaging::Moments::variance() const {
  return count > 1 ? squares / (static_cast<double>(count) - 1.0) : 0.0;
}

void Averaging::begin(std::uint64_t frames, std::uint64_t id) {
  wanted_ = std::max<std::uint64_t>(1, frames);
  id_ = id;
  frames_ = 0;
  all_ = batch_ = batch_means_ = {};
}

bool Averaging::add(const Frame& raw) {
  ++frames_;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if ((raw.valid >> i & 1U) == 0 || !std::isfinite(raw.value[i])) continue;
    all_[i].add(raw.value[i]);
    batch_[i].add(raw.value[i]);
  }
  if (frames_ % std::max<std::uint64_t>(1, wanted_ / batches) == 0) close_batch();
  return frames_ >= wanted_;
}

void Averaging::close_batch() {
  for (std::size_t i = 0; i < channel_count; ++i) {
    if (batch_[i].count > 0) batch_means_[i].add(batch_[i].mean);
  }
  batch_ = {};
}

Average Averaging::take() {
  Average out;
  out.frames = frames_;
  for (std::size_t i = 0; i < channel_count; ++i) {
    const auto count = static_cast<double>(all_[i].count);
    out.count[i] = all_[i].count;
    out.mean[i] = all_[i].mean;
    out.deviation[i] = std::sqrt(all_[i].variance());
    const double variance_of_mean =
        batch_means_[i].variance() / std::max(1.0, static_cast<double>(batch_means_[i].count));
    const double effective = variance_of_mean > 0.0 ? all_[i].variance() / variance_of_mean : count;
    out.independent[i] = std::clamp(effective, std::min(1.0, count), count);
  }
  wanted_ = 0;
  return out;
}

}  // namespace stickslip::daemon
