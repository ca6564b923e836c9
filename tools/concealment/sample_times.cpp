// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/sample_times.h"

#include <algorithm>
#include <cmath>

namespace stickslip::concealment {

namespace {

// The first row half a period late: no time is negative. Whole microseconds, as loggers write them.
double jittered(const Clock& clock, std::size_t row, RandomSource& random) {
  const double off = std::clamp(clock.jitter * random.normal(), -0.4, 0.4);
  const double time_s = (static_cast<double>(row) + 0.5 + off) / clock.rate_hz;
  return std::round(time_s * 1.0e6) / 1.0e6;
}

std::int64_t written(double time_s, double step_s) {
  const double shown_s = step_s > 0.0 ? std::round(time_s / step_s) * step_s : time_s;
  return std::llround(1.0e9 * shown_s);
}

}  // namespace

SampleTimes sample_times(const Clock& clock, double duration_s, RandomSource& random) {
  SampleTimes times;
  const auto count = static_cast<std::size_t>(std::llround(duration_s * clock.rate_hz));
  for (std::size_t row = 0; row < count; ++row) {
    const double time_s = clock.jitter > 0.0 ? jittered(clock, row, random)
                                             : static_cast<double>(row) / clock.rate_hz;
    times.sampled_s.push_back(time_s);
    times.written_ns.push_back(written(time_s, clock.written_to_s));
  }
  return times;
}

}  // namespace stickslip::concealment
