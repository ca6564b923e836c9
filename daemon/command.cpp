#include "daemon/command.h"

#include <algorithm>
#include <cmath>

namespace stickslip::daemon {

void Averaging::begin(std::uint64_t frames, std::uint64_t id) {
  wanted_ = std::max<std::uint64_t>(1, frames);
  id_ = id;
  sum_ = Average();
}

bool Averaging::add(const Frame& raw) {
  ++sum_.frames;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if ((raw.valid >> i & 1U) == 0 || !std::isfinite(raw.value[i])) continue;
    const double off = raw.value[i] - sum_.mean[i];
    sum_.mean[i] += off / static_cast<double>(++sum_.count[i]);
    sum_.deviation[i] += off * (raw.value[i] - sum_.mean[i]);
  }
  return sum_.frames >= wanted_;
}

Average Averaging::take() {
  Average out = sum_;
  for (std::size_t i = 0; i < channel_count; ++i) {
    const auto freedom = static_cast<double>(out.count[i]) - 1.0;
    out.deviation[i] = freedom > 0.0 ? std::sqrt(out.deviation[i] / freedom) : 0.0;
  }
  wanted_ = 0;
  return out;
}

}  // namespace stickslip::daemon
