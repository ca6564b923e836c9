// SPDX-License-Identifier: Apache-2.0
#include "protocol/time_steps.h"

#include <algorithm>
#include <cmath>

#include "physics/number_text.h"

namespace stickslip::protocol {
namespace {

constexpr double periods_of_a_step = 10.0;
constexpr double share_of_a_step = 0.01;  // of the time that lost frames took
constexpr std::size_t most_intervals = 1U << 16U;
constexpr std::uint64_t first_intervals = 64;
constexpr double memory = 32.0;  // intervals
constexpr double shortest_period_s = 1e-9;

bool is_step(double interval_s, double period_s, double numbers, double periods) {
  const double regular_s = period_s * numbers;
  return std::abs(interval_s - regular_s) >
         std::max(periods * period_s, share_of_a_step * regular_s);
}

}  // namespace

std::string sentence_of(const TimeStep& step) {
  return "the time steps by " + physics::fixed_text(step.excess_s, 3) + " s after " +
         physics::fixed_text(static_cast<double>(step.after_ns) * 1e-9, 3) + " s (sequence " +
         std::to_string(step.after_sequence) + "): the clock was set, or the device stood still";
}

void TimeSteps::add(std::uint64_t sequence, std::int64_t from_ns, std::int64_t to_ns,
                    std::uint64_t numbers) {
  const double interval_s = (static_cast<double>(to_ns) - static_cast<double>(from_ns)) * 1e-9;
  const auto n = static_cast<double>(numbers);
  const double each_s = interval_s / n;
  if (count_ % every_ == 0) intervals_s_.push_back(each_s);
  if (intervals_s_.size() == most_intervals) thin_out();
  // Half of a step, since the median of all is not known yet.
  if (!full_ &&
      (count_ < first_intervals || is_step(interval_s, recent_s_, n, 0.5 * periods_of_a_step))) {
    candidates_.push_back({{sequence, from_ns, interval_s}, n});
    if (candidates_.size() == most_intervals) drop_regular_candidates();
    full_ = candidates_.size() == most_intervals;
  }
  const double bounded_s =
      count_ == 0 ? each_s : std::clamp(each_s, 0.0, periods_of_a_step * recent_s_);
  recent_s_ += (bounded_s - recent_s_) / (count_ == 0 ? 1.0 : memory);
  recent_s_ = std::max(recent_s_, shortest_period_s);
  ++count_;
}

std::vector<TimeStep> TimeSteps::found() {
  drop_regular_candidates();
  const double period_s = median_s();
  std::vector<TimeStep> out;
  for (const auto& [step, numbers] : candidates_) {
    out.push_back(step);
    out.back().excess_s -= period_s * numbers;
  }
  return out;
}

double TimeSteps::median_s() {
  if (intervals_s_.empty()) return 0.0;
  std::vector<double> intervals = intervals_s_;
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  return *middle;
}

void TimeSteps::thin_out() {
  for (std::size_t i = 0; 2 * i < intervals_s_.size(); ++i) intervals_s_[i] = intervals_s_[2 * i];
  intervals_s_.resize(intervals_s_.size() / 2);
  every_ *= 2;
}

void TimeSteps::drop_regular_candidates() {
  const double period_s = median_s();
  std::erase_if(candidates_, [period_s](const Candidate& candidate) {
    return !is_step(candidate.step.excess_s, period_s, candidate.numbers, periods_of_a_step);
  });
}

std::vector<TimeStep> time_steps_of(std::span<const Frame> frames) {
  TimeSteps steps;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const Frame& before = frames[i - 1];
    if (frames[i].sequence <= before.sequence) continue;
    steps.add(before.sequence, before.time_ns, frames[i].time_ns,
              frames[i].sequence - before.sequence);
  }
  return steps.found();
}

}  // namespace stickslip::protocol
