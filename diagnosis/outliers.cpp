// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/outliers.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "diagnosis/median.h"
#include "diagnosis/wide_band.h"

namespace stickslip::diagnosis {

namespace {

// Longest run of bad samples: a longer excursion may be an event.
constexpr std::size_t longest_run = 8;
// Good samples on each side that a suspect is compared with.
constexpr std::size_t neighbours = 3;
// Share of the samples of a channel beyond which suspects are part of its signal.
constexpr double rare = 0.005;
// Distance from the range of the neighbours, in multiples of that range and of the noise.
// Neighbours in white noise span 2.5 standard deviations; an edge spans itself.
constexpr double ranges_away = 4.0;
constexpr double noises_away = 8.0;
constexpr double noises_away_within = 12.0;
// Bend of another channel, over what is usual around and over the noise, that makes an event of a
// suspect.
constexpr double bend_ratio = 8.0;
// Excursion beyond any event, in ranges of the channel.
constexpr double absurd_ranges = 10.0;

struct Range {
  double low = 0.0;
  double high = 0.0;

  double width() const { return high - low; }
  double outside(double value) const { return std::max({0.0, value - high, low - value}); }
  void include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
};

// The readings of a channel, without frames that lack it.
struct Series {
  std::vector<double> value;
  std::vector<std::size_t> frame;
  std::vector<std::size_t> piece_end;  // by sample: end of its piece between two gaps
  std::vector<std::size_t> piece_begin;
  double noise = 0.0;
  Range ordinary;  // of all but the rarest values, half their range wider
  double span = 0.0;
};

std::int64_t median_step_ns(const std::vector<Frame>& frames,
                            const std::vector<std::size_t>& which) {
  std::vector<std::int64_t> steps;
  steps.reserve(which.size());
  for (std::size_t i = 1; i < which.size(); ++i) {
    steps.push_back(frames[which[i]].time_ns - frames[which[i - 1]].time_ns);
  }
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

void set_pieces(const std::vector<Frame>& frames, Series& s) {
  const std::size_t n = s.frame.size();
  // A masked sample or two lost frames are no gap.
  const std::int64_t longest = 3 * median_step_ns(frames, s.frame) + 1;
  s.piece_begin.assign(n, 0);
  s.piece_end.assign(n, n);
  for (std::size_t i = 1; i < n; ++i) {
    const bool gap = frames[s.frame[i]].time_ns - frames[s.frame[i - 1]].time_ns > longest;
    s.piece_begin[i] = gap ? i : s.piece_begin[i - 1];
  }
  for (std::size_t i = n - 1; i-- > 0;) {
    s.piece_end[i] = s.piece_begin[i + 1] == i + 1 ? i + 1 : s.piece_end[i + 1];
  }
}

void set_ordinary_range(Series& s) {
  std::vector<double> sorted = s.value;
  const auto rank = [&](double share) {
    const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(sorted.size() - 1));
    std::nth_element(sorted.begin(), sorted.begin() + at, sorted.end());
    return sorted[static_cast<std::size_t>(at)];
  };
  const double low = rank(rare);
  const double high = rank(1.0 - rare);
  s.span = high - low;
  s.ordinary = {low - 0.5 * s.span, high + 0.5 * s.span};
}

Series series_of(const protocol::Recording& recording, Channel channel) {
  Series s;
  for (std::size_t i = 0; i < recording.frames.size(); ++i) {
    const Frame& frame = recording.frames[i];
    if (!frame.has(channel)) continue;
    s.value.push_back(frame[channel]);
    s.frame.push_back(i);
  }
  if (s.value.size() < 32) return {};
  s.noise = noise_of(s.value);
  set_pieces(recording.frames, s);
  set_ordinary_range(s);
  return s;
}

// Samples [begin, end) of a series, with what surrounds them.
struct Suspect {
  std::size_t begin = 0;
  std::size_t end = 0;
  Range around;
  double expected = 0.0;
  bool both_sides = false;
};

// The nearest samples of one side, first the nearest, without those that are suspect themselves.
std::vector<double> beside(const Series& s, std::size_t from, std::size_t to, bool backwards) {
  std::vector<double> out;
  const std::size_t count = std::min(to - from, longest_run + neighbours);
  for (std::size_t i = 0; i < count && out.size() < neighbours; ++i) {
    const double value = s.value[backwards ? to - 1 - i : from + i];
    if (s.ordinary.outside(value) <= 0.0) out.push_back(value);
  }
  return out;
}

std::optional<Suspect> suspect_at(const Series& s, std::size_t begin, std::size_t end) {
  const auto before = beside(s, s.piece_begin[begin], begin, true);
  const auto after = beside(s, end, s.piece_end[end - 1], false);
  const bool both_sides = before.size() == neighbours && after.size() == neighbours;
  if (before.size() < neighbours && after.size() < neighbours) return std::nullopt;
  const double first = before.empty() ? after.front() : before.front();
  const double second = after.empty() ? before.front() : after.front();
  Suspect out{begin, end, {first, first}, 0.5 * (first + second), both_sides};
  for (const double value : before) out.around.include(value);
  for (const double value : after) out.around.include(value);
  return out;
}

// Distance of the nearest of its samples from the range of its neighbours.
double distance(const Series& s, const Suspect& suspect) {
  double least = suspect.around.outside(s.value[suspect.begin]);
  for (std::size_t i = suspect.begin; i < suspect.end; ++i) {
    least = std::min(least, suspect.around.outside(s.value[i]));
  }
  return least;
}

bool stands_out(const Series& s, const Suspect& suspect, double noises) {
  // Beside an end or a gap the signal is extrapolated.
  const double extrapolated = suspect.both_sides ? 1.0 : 2.0;
  return distance(s, suspect) >
         extrapolated * (ranges_away * suspect.around.width() + noises * s.noise);
}

// The same for one sample of a motion that is fast but smooth: polynomials through its neighbours,
// of either side and of both, agree with each other and not with it. At an edge they disagree.
bool leaves_the_curve(const Series& s, std::size_t i) {
  const auto& x = s.value;
  const double before = 3.0 * x[i - 1] - 3.0 * x[i - 2] + x[i - 3];
  const double after = 3.0 * x[i + 1] - 3.0 * x[i + 2] + x[i + 3];
  const double cubic = (4.0 * (x[i - 1] + x[i + 1]) - x[i - 2] - x[i + 2]) / 6.0;
  Range curve{cubic, cubic};
  curve.include(before);
  curve.include(after);
  return curve.outside(x[i]) > ranges_away * curve.width() + noises_away_within * s.noise;
}

using AllSeries = std::array<Series, channel_count>;

double bend(const Series& s, std::size_t i) {
  return std::abs(s.value[i + 1] - 2.0 * s.value[i] + s.value[i - 1]);
}

// True if the channel bends near frames [first, last] as it does nowhere around.
bool bends_at(const Series& s, std::size_t first, std::size_t last) {
  if (s.value.empty()) return false;
  const auto position = [&](std::size_t frame) {
    return static_cast<std::size_t>(std::lower_bound(s.frame.begin(), s.frame.end(), frame) -
                                    s.frame.begin());
  };
  const std::size_t n = s.value.size();
  const std::size_t from = std::max<std::size_t>(position(first), 3) - 2;
  const std::size_t to = std::min(position(last) + 3, n - 1);
  double sharpest = 0.0;
  for (std::size_t i = from; i < to; ++i) sharpest = std::max(sharpest, bend(s, i));
  std::vector<double> usual;
  for (std::size_t i = from > 30 ? from - 30 : 1; i < std::min(to + 30, n - 1); ++i) {
    if (i < from || i >= to) usual.push_back(bend(s, i));
  }
  if (usual.empty()) return false;
  return sharpest > bend_ratio * std::max(median(std::move(usual)), 2.45 * s.noise);
}

bool another_channel_bends(const AllSeries& all, std::size_t channel, const Suspect& suspect) {
  const std::size_t first = all[channel].frame[suspect.begin];
  const std::size_t last = all[channel].frame[suspect.end - 1];
  for (std::size_t c = 0; c < channel_count; ++c) {
    if (c != channel && bends_at(all[c], first, last)) return true;
  }
  return false;
}

// A blow of a hammer may last a sample: the mass moves faster behind it than before.
bool moves_the_mass(const Series& x, std::size_t frame) {
  constexpr std::size_t count = 20;
  const auto at = static_cast<std::size_t>(std::lower_bound(x.frame.begin(), x.frame.end(), frame) -
                                           x.frame.begin());
  if (at <= count || at + count + 1 >= x.value.size()) return true;
  double before = 0.0;
  double after = 0.0;
  for (std::size_t i = 1; i <= count; ++i) {
    before += std::abs(x.value[at - i] - x.value[at - i - 1]);
    after += std::abs(x.value[at + i + 1] - x.value[at + i]);
  }
  return after > 1.5 * before + 0.5 * static_cast<double>(count) * x.noise;
}

// Runs of samples beyond the ordinary range.
void find_beyond(const AllSeries& all, std::size_t channel, std::vector<Suspect>& found) {
  const Series& s = all[channel];
  for (std::size_t i = 0; i < s.value.size();) {
    if (s.ordinary.outside(s.value[i]) <= 0.0) {
      ++i;
      continue;
    }
    std::size_t end = i + 1;
    while (end < s.piece_end[i] && s.ordinary.outside(s.value[end]) > 0.0) ++end;
    const auto suspect = end - i <= longest_run ? suspect_at(s, i, end) : std::nullopt;
    i = end;
    if (!suspect || !stands_out(s, *suspect, noises_away)) continue;
    const bool absurd = distance(s, *suspect) > absurd_ranges * s.span;
    const bool alone = suspect->end - suspect->begin == 1;
    if (!absurd && !alone && another_channel_bends(all, channel, *suspect)) continue;
    if (channel == index_of(Channel::drive_force) &&
        moves_the_mass(all[index_of(Channel::displacement)], s.frame[suspect->begin])) {
      continue;
    }
    found.push_back(*suspect);
  }
}

// Single samples within the ordinary range. Forces may jump there and back: friction that reverses
// for a sample, a drive of pulses.
void find_within(const AllSeries& all, std::size_t channel, std::vector<Suspect>& found) {
  const bool force =
      channel == index_of(Channel::drive_force) || channel == index_of(Channel::friction_force);
  const Series& s = all[channel];
  if (force || !(s.noise > 0.0)) return;
  std::vector<Suspect> within;
  for (std::size_t i = 0; i < s.value.size(); ++i) {
    if (s.ordinary.outside(s.value[i]) > 0.0) continue;
    if (i < s.piece_begin[i] + neighbours || i + neighbours >= s.piece_end[i]) continue;
    const auto suspect = suspect_at(s, i, i + 1);
    if (!suspect || !suspect->both_sides) continue;
    if (!stands_out(s, *suspect, noises_away_within) && !leaves_the_curve(s, i)) continue;
    if (!another_channel_bends(all, channel, *suspect)) within.push_back(*suspect);
  }
  if (static_cast<double>(within.size()) > rare * static_cast<double>(s.value.size())) return;
  found.insert(found.end(), within.begin(), within.end());
}

std::vector<Outlier> found_once(const protocol::Recording& recording) {
  AllSeries all;
  for (const Channel channel : all_channels) {
    all[index_of(channel)] = series_of(recording, channel);
  }
  std::vector<Outlier> out;
  for (const Channel channel : all_channels) {
    const Series& s = all[index_of(channel)];
    std::vector<Suspect> found;
    find_beyond(all, index_of(channel), found);
    find_within(all, index_of(channel), found);
    for (const Suspect& suspect : found) {
      for (std::size_t i = suspect.begin; i < suspect.end; ++i) {
        out.push_back({channel, s.frame[i], recording.frames[s.frame[i]].time_s(), s.value[i],
                       suspect.expected});
      }
    }
  }
  return out;
}

void mask(const std::vector<Outlier>& outliers, protocol::Recording& recording) {
  for (const Outlier& each : outliers) recording.frames[each.frame].invalidate(each.channel);
}

}  // namespace

std::vector<Outlier> outliers_of(const protocol::Recording& recording) {
  return Cleaned(recording).outliers();
}

Cleaned::Cleaned(const protocol::Recording& recording) : original_(recording) {
  // An outlier may hide one beside it.
  constexpr int passes = 3;
  for (int pass = 0; pass < passes; ++pass) {
    const std::vector<Outlier> found = found_once(this->recording());
    if (found.empty()) break;
    if (!copy_) copy_ = original_;
    mask(found, *copy_);
    outliers_.insert(outliers_.end(), found.begin(), found.end());
  }
  std::sort(outliers_.begin(), outliers_.end(), [](const Outlier& a, const Outlier& b) {
    return std::pair(a.channel, a.frame) < std::pair(b.channel, b.frame);
  });
}

}  // namespace stickslip::diagnosis
