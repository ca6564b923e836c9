// SPDX-License-Identifier: Apache-2.0
#include "drivers/bench/readback_check.h"

#include <algorithm>

namespace stickslip::drivers {

namespace {

constexpr std::int64_t slices_per_delay = 4;
// A command that was replaced before it was sent never appears.
constexpr double unsent_share = 0.25;

}  // namespace

ReadbackCheck::ReadbackCheck(const Settings& settings)
    : slice_ns_(std::max<std::int64_t>(settings.longest_delay_ns / slices_per_delay, 1)),
      tolerance_(settings.tolerance) {}

void ReadbackCheck::restart() {
  slices_.fill(Slice());
  commanded_ = -1;
  read_ = -1;
  failures_ = 0;
}

void ReadbackCheck::command(double value, std::int64_t time_ns) {
  const std::int64_t number = time_ns / slice_ns_;
  const bool first = commanded_ < 0;
  if (first) value_ = value;
  // The output holds its value between commands.
  const auto oldest = number - static_cast<std::int64_t>(slices_.size()) + 1;
  for (std::int64_t k = first ? number : std::max(commanded_ + 1, oldest); k <= number; ++k) {
    at(k) = Slice{.number = k, .command_low = value_, .command_high = value_};
  }
  commanded_ = std::max(commanded_, number);
  value_ = value;
  Slice& slice = at(commanded_);
  slice.command_low = std::min(slice.command_low, value);
  slice.command_high = std::max(slice.command_high, value);
}

void ReadbackCheck::reading(double value, std::int64_t time_ns) {
  const std::int64_t number = time_ns / slice_ns_;
  if (read_ >= 0 && number > read_ && read_ >= 1) check(read_ - 1);
  read_ = std::max(read_, number);
  Slice& slice = at(number);
  if (slice.number != number) return;  // before the first command, or too late
  if (slice.readings == 0) slice.reading_low = slice.reading_high = value;
  slice.reading_low = std::min(slice.reading_low, value);
  slice.reading_high = std::max(slice.reading_high, value);
  slice.reading_sum += value;
  ++slice.readings;
}

/// False if not every slice of the span is known.
bool ReadbackCheck::commanded(std::int64_t first, std::int64_t last, Span& span) {
  for (std::int64_t k = first; k <= last; ++k) {
    const Slice& slice = at(k);
    if (k < 0 || slice.number != k) return false;
    span.low = k == first ? slice.command_low : std::min(span.low, slice.command_low);
    span.high = k == first ? slice.command_high : std::max(span.high, slice.command_high);
  }
  return true;
}

// The next slice has ended too: a time stamp that is early by less than one does no harm.
void ReadbackCheck::check(std::int64_t number) {
  Span known;
  if (!commanded(number - 2 * slices_per_delay, number + 1, known)) return;
  if (at(number).readings == 0) return;
  failures_ = fails(number) ? failures_ + 1 : 0;
}

bool ReadbackCheck::fails(std::int64_t number) {
  Span before;
  commanded(number - slices_per_delay - 1, number + 1, before);
  const Slice& slice = at(number);
  const double mean = slice.reading_sum / slice.readings;
  if (mean < before.low - tolerance_ || mean > before.high + tolerance_) {
    difference_ = {mean, before.low, before.high};
    return true;
  }
  Span due;
  Span all;
  const std::int64_t first = number - 2 * slices_per_delay;
  commanded(first, number - slices_per_delay - 2, due);
  commanded(first, number, all);
  double low = slice.reading_low;
  double high = slice.reading_high;
  for (std::int64_t k = first; k < number; ++k) {
    if (at(k).readings == 0) return false;
    low = std::min(low, at(k).reading_low);
    high = std::max(high, at(k).reading_high);
  }
  const double slack = tolerance_ + unsent_share * (all.high - all.low);
  if (high >= due.high - slack && low <= due.low + slack) return false;
  difference_ = {mean, due.low, due.high};
  return true;
}

}  // namespace stickslip::drivers
