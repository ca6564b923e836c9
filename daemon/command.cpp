#include "daemon/command.h"

#include <algorithm>
#include <cmath>

namespace stickslip::daemon {

void Averaging::Moments::add(double value) {
  const double off = value - mean;
  mean += off / static_cast<double>(++count);
  squares += off * (value - mean);
}

double Averaging::Moments::variance() const {
  return count > 1 ? squares / (static_cast<double>(count) - 1.0) : 0.0;
}

void Averaging::begin(std::uint64_t frames, std::uint64_t id) {
  wanted_ = std::max<std::uint64_t>(1, frames);
  id_ = id;
  frames_ = 0;
  all_ = part_ = part_means_ = {};
}

bool Averaging::add(const Frame& raw) {
  ++frames_;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if ((raw.valid >> i & 1U) == 0 || !std::isfinite(raw.value[i])) continue;
    all_[i].add(raw.value[i]);
    part_[i].add(raw.value[i]);
  }
  if (frames_ % std::max<std::uint64_t>(1, wanted_ / parts) == 0) close_part();
  return frames_ >= wanted_;
}

void Averaging::close_part() {
  for (std::size_t i = 0; i < channel_count; ++i) {
    if (part_[i].count > 0) part_means_[i].add(part_[i].mean);
  }
  part_ = {};
}

Average Averaging::take() {
  Average out;
  out.frames = frames_;
  for (std::size_t i = 0; i < channel_count; ++i) {
    const auto count = static_cast<double>(all_[i].count);
    out.count[i] = all_[i].count;
    out.mean[i] = all_[i].mean;
    out.deviation[i] = std::sqrt(all_[i].variance());
    const double of_mean =
        part_means_[i].variance() / std::max(1.0, static_cast<double>(part_means_[i].count));
    const double alike = of_mean > 0.0 ? all_[i].variance() / of_mean : count;
    out.independent[i] = std::clamp(alike, std::min(1.0, count), count);
  }
  wanted_ = 0;
  return out;
}

}  // namespace stickslip::daemon
