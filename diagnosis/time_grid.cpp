// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/time_grid.h"

#include <algorithm>
#include <cmath>

#include "protocol/recording.h"

namespace stickslip::diagnosis {

namespace {

// Frames without a long gap between them.
struct Rows {
  std::size_t begin = 0;
  std::size_t end = 0;
};

// Times of the frames, each after the first one of its rows: exact, however long the gaps.
struct Times {
  std::vector<double> s;
  std::vector<Rows> rows;
  double resolution_s = 0.0;  // decimal place to which they were rounded
};

std::int64_t step_ns(std::span<const Frame> frames, std::size_t i) {
  return frames[i].time_ns - frames[i - 1].time_ns;
}

// The largest power of ten that divides all steps.
double resolution_of(std::span<const Frame> frames) {
  std::int64_t place = 1'000'000'000;
  for (std::size_t i = 1; i < frames.size() && place > 1; ++i) {
    while (step_ns(frames, i) % place != 0) place /= 10;
  }
  return 1.0e-9 * static_cast<double>(place);
}

Times times_of(std::span<const Frame> frames, double rough_s) {
  Times out;
  out.resolution_s = resolution_of(frames);
  out.s.assign(frames.size(), 0.0);
  const double longest_ns = 1.0e9 * rough_s * (longest_hole_periods + 0.5);
  Rows rows;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    if (static_cast<double>(step_ns(frames, i)) > longest_ns) {
      rows.end = i;
      out.rows.push_back(rows);
      rows.begin = i;
    }
    out.s[i] = 1.0e-9 * static_cast<double>(frames[i].time_ns - frames[rows.begin].time_ns);
  }
  rows.end = frames.size();
  out.rows.push_back(rows);
  return out;
}

// Of a time from the nearest instant.
double residual(double time_s, double period_s) {
  return time_s - period_s * std::nearbyint(time_s / period_s);
}

// Mean of the steps that the rounding of the times makes of the median one. A median alone is as
// coarse as that rounding.
double mean_step_s(std::span<const Frame> frames, double median_s, double resolution_s) {
  double sum = 0.0;
  double count = 0.0;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const double step = 1.0e-9 * static_cast<double>(step_ns(frames, i));
    if (std::abs(step - median_s) > 1.01 * resolution_s) continue;
    sum += step;
    count += 1.0;
  }
  return sum / count;
}

// Where instant 0 of these rows is, with the period known: rounded residuals are bounded, so that
// no outlier can pull it away.
double offset_of(const Times& times, const Rows& rows, double period_s) {
  double offset = 0.0;
  for (int pass = 0; pass < 3; ++pass) {
    double sum = 0.0;
    for (std::size_t i = rows.begin; i < rows.end; ++i) {
      sum += residual(times.s[i] - times.s[rows.begin] - offset, period_s);
    }
    offset += sum / static_cast<double>(rows.end - rows.begin);
  }
  return times.s[rows.begin] + offset;
}

// Sums of a regression with one slope for all blocks of rows and an intercept for each.
struct Slope {
  double nn = 0.0;
  double nt = 0.0;

  void add(const Times& times, const Rows& block, double period_s) {
    const double offset = offset_of(times, block, period_s);
    const auto count = static_cast<double>(block.end - block.begin);
    double n_mean = 0.0;
    double residual_mean = 0.0;
    const auto number = [&](std::size_t i) {
      return std::nearbyint((times.s[i] - offset) / period_s);
    };
    for (std::size_t i = block.begin; i < block.end; ++i) {
      n_mean += number(i) / count;
      residual_mean += (times.s[i] - offset - number(i) * period_s) / count;
    }
    for (std::size_t i = block.begin; i < block.end; ++i) {
      const double n = number(i) - n_mean;
      nn += n * n;
      nt += n * (times.s[i] - offset - number(i) * period_s - residual_mean);
    }
  }
};

// A period that is a little wrong numbers the rows rightly over short blocks only, and these give a
// better one: blocks grow until they are as long as the longest rows.
double refined(const Times& times, double period_s) {
  std::size_t longest = 0;
  for (const Rows& rows : times.rows) longest = std::max(longest, rows.end - rows.begin);
  for (std::size_t size = 8; size / 4 < longest; size *= 4) {
    for (int pass = 0; pass < 2; ++pass) {
      Slope slope;
      for (const Rows& rows : times.rows) {
        for (std::size_t begin = rows.begin; begin < rows.end; begin += size) {
          const Rows block{begin, std::min(rows.end, begin + size)};
          if (block.end - block.begin >= 3) slope.add(times, block, period_s);
        }
      }
      if (slope.nn > 0.0) period_s += slope.nt / slope.nn;
    }
  }
  return period_s;
}

struct Clock {
  double period_s = 0.0;
  std::vector<double> offset_s;  // by rows
  double mean_square = 0.0;      // of the residuals
  bool is_only_rounded = false;  // the residuals are no larger than rounding makes them
};

Clock clock_with(const Times& times, double period_s) {
  Clock out;
  out.period_s = period_s;
  for (const Rows& rows : times.rows) {
    out.offset_s.push_back(offset_of(times, rows, period_s));
    for (std::size_t i = rows.begin; i < rows.end; ++i) {
      const double off = residual(times.s[i] - out.offset_s.back(), period_s);
      out.mean_square += off * off / static_cast<double>(times.s.size());
    }
  }
  // Residuals of independent rounding have the variance resolution^2 / 12. A recorded time is
  // better than the line if the line's variance without that is larger.
  const double rounding = times.resolution_s * times.resolution_s / 12.0;
  constexpr double negligible_periods = 1.0e-4;
  out.is_only_rounded = out.mean_square <= 2.0 * rounding ||
                        out.mean_square <= std::pow(negligible_periods * period_s, 2);
  return out;
}

// Of two clocks that explain the times the slower one, which needs fewer missing rows.
bool is_better(const Clock& one, const Clock& other) {
  if (one.is_only_rounded != other.is_only_rounded) return one.is_only_rounded;
  if (one.is_only_rounded) return one.period_s > 1.01 * other.period_s;
  return one.mean_square / (one.period_s * one.period_s) <
         other.mean_square / (other.period_s * other.period_s);
}

Clock fitted_clock(std::span<const Frame> frames, const Times& times, double median_s) {
  Clock best = clock_with(times, refined(times, median_s));
  const double mean_s = mean_step_s(frames, median_s, times.resolution_s);
  if (std::abs(mean_s - median_s) > 1.0e-9 * median_s) {
    Clock other = clock_with(times, refined(times, mean_s));
    if (is_better(other, best)) best = std::move(other);
  }
  if (times.rows.size() > 1) return best;
  // Without missing rows the mean period is as good, and exact where the times are.
  const double steps = std::nearbyint(times.s.back() / best.period_s);
  if (steps + 1.0 == static_cast<double>(frames.size())) {
    Clock mean = clock_with(times, times.s.back() / steps);
    if (mean.mean_square <= 1.0e-18) best = std::move(mean);
  }
  return best;
}

// Numbers rows by the instant that is nearest, and resolves collisions: a row that was late, and
// its predecessors, move back into a free instant; one that was early takes the next.
class Numbering {
 public:
  Numbering(std::span<const Frame> frames, const Rows& rows) : frames_(frames), rows_(rows) {}

  std::vector<std::int64_t> of(const Times& times, double offset_s, double period_s) {
    for (std::size_t i = rows_.begin; i < rows_.end; ++i) {
      add(i, std::llround((times.s[i] - offset_s) / period_s));
    }
    return std::move(number_);
  }

 private:
  void add(std::size_t frame, std::int64_t wanted) {
    const std::uint8_t valid = frames_[frame].valid;
    if (number_.empty() || wanted > number_.back()) {
      number_.push_back(wanted);
      taken_ = valid;
      return;
    }
    if (wanted == number_.back() && (taken_ & valid) == 0) {  // another channel of the same instant
      number_.push_back(wanted);
      taken_ = static_cast<std::uint8_t>(taken_ | valid);
      return;
    }
    if (wanted < number_.back() || !make_room()) wanted = number_.back() + 1;
    number_.push_back(wanted);
    taken_ = valid;
  }
  bool make_room() {
    constexpr std::size_t farthest = 64;
    std::size_t from = number_.size() - 1;
    while (from > 0 && number_.size() - from < farthest && number_[from - 1] >= number_[from] - 1) {
      --from;
    }
    if (from > 0 && number_[from - 1] >= number_[from] - 1) return false;
    for (std::size_t j = from; j < number_.size(); ++j) --number_[j];
    return true;
  }

  std::span<const Frame> frames_;
  Rows rows_;
  std::vector<std::int64_t> number_;
  std::uint8_t taken_ = 0;  // channels of the last instant
};

}  // namespace

TimeGrid time_grid_of(std::span<const Frame> frames) {
  const double median_s = protocol::median_period_s(frames);
  const Times times = times_of(frames, median_s);
  const Clock clock = fitted_clock(frames, times, median_s);
  TimeGrid grid;
  grid.period_s = clock.period_s;
  grid.start_s = frames.front().time_s();
  grid.instant.resize(frames.size());
  if (!clock.is_only_rounded) grid.after_s.resize(frames.size());
  std::size_t next = 0;
  for (std::size_t r = 0; r < times.rows.size(); ++r) {
    const Rows& rows = times.rows[r];
    const double offset = clock.offset_s[r] - clock.offset_s.front();
    const auto number = Numbering(frames, rows).of(times, clock.offset_s[r], clock.period_s);
    const std::int64_t first = number.front();
    const double from_start_s =
        1.0e-9 * static_cast<double>(frames[rows.begin].time_ns - frames.front().time_ns);
    grid.segments.push_back({next, 0, 0.0, rows.begin});
    TimeGrid::Segment& segment = grid.segments.back();
    segment.start_s = from_start_s + offset + clock.period_s * static_cast<double>(first);
    for (std::size_t i = rows.begin; i < rows.end; ++i) {
      const std::int64_t n = number[i - rows.begin];
      grid.instant[i] = static_cast<std::uint32_t>(next + static_cast<std::size_t>(n - first));
      segment.end = grid.instant[i] + 1U;
      if (grid.after_s.empty()) continue;
      const double after = times.s[i] - clock.offset_s[r] - clock.period_s * static_cast<double>(n);
      grid.after_s[i] = static_cast<float>(after);
      grid.jitter_s = std::max(grid.jitter_s, std::abs(after));
    }
    next = segment.end + 1;
  }
  const double start = grid.segments.front().start_s;
  if (!grid.after_s.empty()) grid.start_s += clock.offset_s.front() + start;
  for (TimeGrid::Segment& segment : grid.segments) segment.start_s -= start;
  return grid;
}

}  // namespace stickslip::diagnosis
