#include "diagnosis/time_grid.h"

#include <cmath>

#include "protocol/recording.h"

namespace stickslip::diagnosis {

TimeGrid time_grid_of(std::span<const Frame> frames) {
  TimeGrid grid;
  const double rough = protocol::median_period_s(frames);
  const double span = static_cast<double>(frames.back().time_ns - frames.front().time_ns) * 1.0e-9;
  const auto intervals = static_cast<std::size_t>(std::llround(span / rough));
  // Without missing frames the mean period is more accurate than the rounded median.
  grid.period_s = intervals == frames.size() - 1 ? span / static_cast<double>(intervals) : rough;
  grid.start_s = frames.front().time_s();
  grid.frame.assign(static_cast<std::size_t>(std::llround(span / grid.period_s)) + 1, -1);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const double at =
        static_cast<double>(frames[i].time_ns - frames.front().time_ns) * 1.0e-9 / grid.period_s;
    const auto k = std::llround(at);
    if (k >= 0 && k < static_cast<long long>(grid.frame.size())) {
      grid.frame[static_cast<std::size_t>(k)] = static_cast<std::ptrdiff_t>(i);
    }
  }
  return grid;
}

std::vector<double> filled(std::span<const Frame> frames, const TimeGrid& grid, Channel channel) {
  std::vector<double> values(grid.frame.size(), 0.0);
  std::ptrdiff_t last = -1;
  for (std::size_t k = 0; k < values.size(); ++k) {
    const std::ptrdiff_t i = grid.frame[k];
    if (i < 0 || !frames[static_cast<std::size_t>(i)].has(channel)) continue;
    values[k] = frames[static_cast<std::size_t>(i)][channel];
    const auto from = static_cast<std::size_t>(last + 1);
    for (std::size_t j = from; j < k; ++j) {
      const double fraction =
          last < 0 ? 1.0 : static_cast<double>(j - from + 1) / static_cast<double>(k - from + 1);
      const double before = last < 0 ? values[k] : values[static_cast<std::size_t>(last)];
      values[j] = before + fraction * (values[k] - before);
    }
    last = static_cast<std::ptrdiff_t>(k);
  }
  for (std::size_t j = static_cast<std::size_t>(last + 1); j < values.size() && last >= 0; ++j) {
    values[j] = values[static_cast<std::size_t>(last)];
  }
  return values;
}

}  // namespace stickslip::diagnosis
