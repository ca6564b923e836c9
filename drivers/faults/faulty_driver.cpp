// SPDX-License-Identifier: Apache-2.0
#include "drivers/faults/faulty_driver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace stickslip::drivers {

namespace {

using config::Fault;
using config::FaultKind;

constexpr std::int64_t longest_step_ns = 10'000'000'000'000'000;  // beyond the times of a script
constexpr std::int64_t latest_ns = 4'000'000'000'000'000'000;     // upper limit of script time
constexpr double max_history = 1U << 20U;                         // frames
constexpr double history_frames_per_period = 2.0;  // margin for devices faster than nominal

/// Order of faults between the device and the caller. Faults of one kind act in the order of the
/// script.
int stage_of(FaultKind kind) {
  switch (kind) {
    case FaultKind::unplug:
      return 0;
    case FaultKind::stall:
      return 1;
    case FaultKind::read_error:
      return 2;
    case FaultKind::delay:
      return 3;
    case FaultKind::drift:
      return 4;
    case FaultKind::noise:
      return 5;
    case FaultKind::saturate:
      return 6;
    case FaultKind::stick:
      return 7;
    case FaultKind::nan:
      return 8;
    case FaultKind::clock_jump:
      return 9;
    case FaultKind::drop:
      return 10;
    case FaultKind::reorder:
      return 11;
    case FaultKind::duplicate:
      return 12;
    case FaultKind::emergency_stop:
      return 13;
    case FaultKind::amplifier_fault:
      return 14;
    case FaultKind::output_differs:
      return 15;
    case FaultKind::write_error:
      return 16;
  }
  return 17;
}

bool withholds(FaultKind kind) {
  return kind == FaultKind::unplug || kind == FaultKind::stall || kind == FaultKind::read_error;
}

std::int64_t ns(double time_s) { return std::llround(time_s * 1.0e9); }

}  // namespace

struct FaultyDriver::Entry {
  Entry(const Fault& of, std::size_t at, const config::FaultScript& script)
      : fault(of),
        position(at),
        chance(script.seed, at),
        timeline(of, chance),
        amount_ns(ns(of.amount)),
        // Marks the fault as injected.
        message("fault " + std::to_string(at + 1) + " of " + script.file.filename().string() +
                ": " + config::in_words(of)) {
    if (of.kind == FaultKind::unplug) {
      reattached = message + "; it is attached again and can be reopened";
    }
  }

  /// True if it affects a channel of a frame.
  bool affects(Channel channel, const Frame& frame) const {
    return frame.has(channel) && (!fault.channel || *fault.channel == channel);
  }

  Fault fault;
  std::size_t position;  // in the script
  Chance chance;
  Timeline timeline;
  std::int64_t amount_ns;  // for kinds whose amount is a time
  std::string message;
  std::string reattached;
  std::uint64_t counted = 0;  // number of the latest occurrence, plus 1

  // stick: the held values and their occurrence.
  std::uint64_t held_in = 0;  // its number, plus 1
  std::uint8_t held = 0;      // bit i: channel i
  std::array<double, channel_count> value{};
};

FaultyDriver::FaultyDriver(std::unique_ptr<Driver> device, const config::FaultScript& script,
                           const Pace& pace, std::shared_ptr<HostClock> clock)
    : device_(std::move(device)),
      clock_(std::move(clock)),
      period_ns_(std::max<std::int64_t>(1, ns(pace.period_s))),
      speed_(pace.speed),
      applied_(script.faults.size()),
      now_ns_(-period_ns_) {
  if (!clock_) clock_ = std::make_shared<MonotonicHostClock>();
  double longest_delay_s = 0.0;
  for (std::size_t i = 0; i < script.faults.size(); ++i) {
    const Fault& fault = script.faults[i];
    entries_.emplace_back(fault, i, script);
    if (fault.kind == FaultKind::delay) longest_delay_s = std::max(longest_delay_s, fault.amount);
  }
  std::stable_sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
    return stage_of(a.fault.kind) < stage_of(b.fault.kind);
  });
  if (longest_delay_s > 0.0) {
    const double frames = std::ceil(longest_delay_s * 1.0e9 / static_cast<double>(period_ns_) *
                                    history_frames_per_period);
    history_.resize(static_cast<std::size_t>(std::min(frames, max_history)) + 2);
  }
  describe();
}

FaultyDriver::~FaultyDriver() = default;

Result FaultyDriver::open() {
  if (unplugged_by_ != nullptr) advance_time_since_attempt();
  for (Entry& entry : entries_) {
    if (entry.fault.kind != FaultKind::unplug || !active_occurrence(entry, due_ns())) continue;
    if (running_) return unplug(entry);
    if (unplugged_by_ == nullptr) {
      attempt_ns_ = clock_->now_ns();
      since_attempt_ns_ = 0;
    }
    unplugged_by_ = &entry;
    hit(entry);
    return {Outcome::lost, entry.message.c_str()};
  }
  const Result opened = device_->open();
  if (!opened) return opened;
  unplugged_by_ = nullptr;
  describe();
  for (const Entry& entry : entries_) {
    const auto channel = entry.fault.channel;
    if (!channel || ((description_.channels >> index_of(*channel)) & 1U) != 0) continue;
    refusal_ = entry.message + ": the device, " + device_->description().name +
               ", does not provide that channel";
    device_->close();
    return {Outcome::needs_attention, refusal_.c_str()};
  }
  return opened;
}

void FaultyDriver::describe() {
  description_ = device_->description();
  if (!entries_.empty()) description_.name += " with injected faults";
}

Result FaultyDriver::start() {
  if (unplugged_by_ != nullptr) return still_unplugged();
  const Result started = device_->start();
  if (!started) return started;
  running_ = true;
  to_be_started_ = false;
  fresh_ = true;
  history_size_ = 0;
  history_next_ = 0;
  return started;
}

void FaultyDriver::stop() noexcept {
  device_->stop();
  discard_pending();
  running_ = to_be_started_ = false;
}

void FaultyDriver::close() noexcept {
  device_->close();
  discard_pending();
  running_ = to_be_started_ = false;
}

Signals FaultyDriver::signals() const noexcept {
  Signals all = device_->signals();
  all.emergency_stop = all.emergency_stop || lines_.emergency_stop;
  all.amplifier_fault = all.amplifier_fault || lines_.amplifier_fault;
  if (lines_.differing_output.name != nullptr) all.differing_output = lines_.differing_output;
  return all;
}

// Reading.

Result FaultyDriver::read(Frame& frame) {
  const Result result = read_with_faults(frame);
  update_lines();
  return result;
}

Result FaultyDriver::read_with_faults(Frame& frame) {
  ++reads_;
  if (unplugged_by_ != nullptr) {
    advance_periods(1);
    hit(*unplugged_by_);
    return still_unplugged();
  }
  if (to_be_started_) return {Outcome::fatal, "read of a device that was unplugged, not started"};
  if (!running_) return device_->read(frame);
  if (const Result withheld = withhold(); !withheld) return withheld;
  if (queued_ > 0) return give(frame);

  // A paced device is read once; any other is read again for the frame that overtakes, so that no
  // delay accumulates.
  const int most = description_.paced ? 1 : 2;
  for (int i = 0; i < most && (i == 0 || !will_be_withheld()); ++i) {
    Frame taken;
    const Result result = device_->read(taken);
    if (!result) {
      if (result.outcome != Outcome::end_of_data || !overtaken_) return result;
      queue(*std::exchange(overtaken_, std::nullopt), overtaken_twice_);
      return give(frame);
    }
    const Fate fate = process(taken);
    if (fate == Fate::delivered) return give(frame);
    if (fate == Fate::dropped) break;
  }
  return {Outcome::no_data, ""};
}

/// The fault that withholds a read from the device; ok if there is none.
Result FaultyDriver::withhold() {
  const std::int64_t due = due_ns();
  for (Entry& entry : entries_) {
    if (!withholds(entry.fault.kind)) break;  // these come first
    const auto occurrence = active_occurrence(entry, due);
    if (!occurrence) continue;
    if (entry.fault.kind == FaultKind::unplug) return unplug(entry);
    if (entry.fault.kind == FaultKind::stall && entry.fault.stall_blocking) {
      hit(entry);
      block(*occurrence);
      return {Outcome::no_data, ""};
    }
    if (!entry.chance.hits(entry.fault.probability, reads_)) continue;
    advance_periods(1);
    hit(entry);
    if (description_.paced) {
      const double wait_ns = static_cast<double>(period_ns_) / speed_;
      clock_->sleep_until(clock_->now_ns() + std::llround(wait_ns));
    }
    if (entry.fault.kind == FaultKind::stall) return {Outcome::no_data, ""};
    return {Outcome::temporary, entry.message.c_str()};
  }
  return {};
}

Result FaultyDriver::unplug(const Entry& entry) {
  advance_periods(1);
  hit(entry);
  unplugged_by_ = &entry;
  running_ = false;
  to_be_started_ = true;
  attempt_ns_ = clock_->now_ns();
  since_attempt_ns_ = 0;
  // Like the watchdog of a board that has lost its host.
  if (description_.can_drive) device_->write({0.0, false});
  discard_pending();
  return {Outcome::lost, entry.message.c_str()};
}

Result FaultyDriver::still_unplugged() const {
  const bool back = !unplugged_by_->timeline.at(due_ns());
  return {Outcome::lost, back ? unplugged_by_->reattached.c_str() : unplugged_by_->message.c_str()};
}

/// Waits until the end of the occurrence, and advances script time accordingly.
void FaultyDriver::block(const Occurrence& occurrence) {
  const std::int64_t left_ns = occurrence.end_ns - (now_ns_ + period_ns_);
  const double wait_ns = static_cast<double>(std::max<std::int64_t>(0, left_ns)) / speed_;
  clock_->sleep_until(clock_->now_ns() + std::llround(wait_ns));
  advance_periods(std::max<std::int64_t>(1, (left_ns + period_ns_ / 2) / period_ns_));
}

bool FaultyDriver::will_be_withheld() const {
  for (const Entry& entry : entries_) {
    if (!withholds(entry.fault.kind)) break;
    if (entry.timeline.at(due_ns())) return true;
  }
  return false;
}

/// Applies the faults to a frame of the device.
FaultyDriver::Fate FaultyDriver::process(Frame taken) {
  advance_time(taken);
  store(taken);
  const std::uint64_t number = account_.taken++;
  delay_channels(taken);
  bool dropped = false;
  bool twice = false;
  const Entry* overtakes = nullptr;
  for (Entry& entry : entries_) {
    const Fault& fault = entry.fault;
    if (withholds(fault.kind) || fault.kind == FaultKind::delay) continue;
    if (stage_of(fault.kind) > stage_of(FaultKind::duplicate)) break;
    const auto occurrence = active_occurrence(entry, now_ns_);
    if (!occurrence || !entry.chance.hits(fault.probability, number)) continue;
    switch (fault.kind) {
      case FaultKind::clock_jump:
        taken.time_ns += entry.amount_ns;
        hit(entry);
        break;
      case FaultKind::drop:
        if (dropped) break;
        dropped = true;
        ++account_.dropped;
        hit(entry);
        break;
      case FaultKind::reorder:
        if (!dropped && overtakes == nullptr && !overtaken_) overtakes = &entry;
        break;
      case FaultKind::duplicate:
        if (dropped || twice) break;
        twice = true;
        ++account_.duplicated;
        hit(entry);
        break;
      default:
        change(entry, *occurrence, taken);
    }
  }
  if (dropped) return Fate::dropped;
  if (overtakes != nullptr) {
    overtaken_ = taken;
    overtaken_twice_ = twice;
    overtaken_by_ = overtakes;
    return Fate::overtaken;
  }
  queue(taken, twice);
  if (overtaken_) {
    hit(*overtaken_by_);
    queue(*std::exchange(overtaken_, std::nullopt), overtaken_twice_);
  }
  return Fate::delivered;
}

Result FaultyDriver::give(Frame& frame) {
  frame = queue_.front();
  std::copy(queue_.begin() + 1, queue_.end(), queue_.begin());
  --queued_;
  ++account_.given;
  return {};
}

void FaultyDriver::queue(const Frame& frame, bool twice) {
  queue_.at(queued_++) = frame;
  if (twice) queue_.at(queued_++) = frame;
}

void FaultyDriver::discard_pending() {
  account_.discarded += account().waiting;
  queued_ = 0;
  overtaken_.reset();
}

// The time of the script.

/// Time of the next read: that at which its frame is due, plus half a period as a margin for the
/// rounding of the period.
std::int64_t FaultyDriver::due_ns() const { return now_ns_ + period_ns_ + period_ns_ / 2; }

void FaultyDriver::advance_time(const Frame& taken) {
  std::int64_t step_ns = 0;
  const bool discontinuous =
      fresh_ || __builtin_sub_overflow(taken.time_ns, latest_frame_ns_, &step_ns) || step_ns <= 0;
  if (discontinuous) step_ns = period_ns_;
  // The step of a device that kept time includes the time that passed without frames.
  if (step_ns - frameless_ns_ >= period_ns_ / 2) step_ns -= frameless_ns_;
  now_ns_ = std::min(latest_ns, now_ns_ + std::min(step_ns, longest_step_ns));
  latest_frame_ns_ = taken.time_ns;
  frameless_ns_ = 0;
  fresh_ = false;
}

void FaultyDriver::advance_periods(std::int64_t count) {
  const std::int64_t passed_ns = std::min(count * period_ns_, latest_ns - now_ns_);
  now_ns_ += passed_ns;
  frameless_ns_ += passed_ns;
  since_attempt_ns_ += passed_ns;
}

// A caller that waits between attempts to open a device does not read meanwhile: host time counts.
void FaultyDriver::advance_time_since_attempt() {
  const std::int64_t host_ns = clock_->now_ns();
  const double passed_ns = std::min(static_cast<double>(host_ns - attempt_ns_) * speed_,
                                    static_cast<double>(longest_step_ns));
  const std::int64_t new_ns = std::llround(passed_ns) - since_attempt_ns_;
  const std::int64_t periods = std::max<std::int64_t>(1, new_ns / period_ns_);
  advance_periods(periods);
  attempt_ns_ = host_ns;
  since_attempt_ns_ = 0;
}

// Faults of channels.

void FaultyDriver::store(const Frame& taken) {
  if (history_.empty()) return;
  history_[history_next_] = taken;
  history_next_ = (history_next_ + 1) % history_.size();
  history_size_ = std::min(history_size_ + 1, history_.size());
}

/// The latest frame not after a time, else the earliest. The history must not be empty.
const Frame& FaultyDriver::as_of(std::int64_t time_ns) const {
  const std::size_t first = history_next_ + history_.size() - history_size_;
  const auto nth = [this, first](std::size_t n) -> const Frame& {
    return history_[(first + n) % history_.size()];
  };
  std::size_t low = 0;  // not after time_ns, or the earliest
  std::size_t high = history_size_;
  while (high - low > 1) {
    const std::size_t middle = low + (high - low) / 2;
    (nth(middle).time_ns <= time_ns ? low : high) = middle;
  }
  return nth(low);
}

/// Of several delays of one channel the longest applies.
void FaultyDriver::delay_channels(Frame& frame) {
  if (history_.empty()) return;
  std::array<const Entry*, channel_count> longest{};
  for (Entry& entry : entries_) {
    if (entry.fault.kind != FaultKind::delay || !active_occurrence(entry, now_ns_)) continue;
    hit(entry);
    for (const Channel channel : all_channels) {
      const Entry*& of_channel = longest[index_of(channel)];
      if (!entry.affects(channel, frame)) continue;
      if (of_channel == nullptr || entry.amount_ns > of_channel->amount_ns) of_channel = &entry;
    }
  }
  for (const Channel channel : all_channels) {
    const std::size_t i = index_of(channel);
    if (longest[i] == nullptr) continue;
    const Frame& old = as_of(frame.time_ns - longest[i]->amount_ns);
    if (!old.has(channel)) {
      frame.invalidate(channel);
      continue;
    }
    frame.value[i] = old.value[i];
    if (!longest[i]->fault.reported) continue;
    const std::int64_t age_us = old.age_us[i] + (frame.time_ns - old.time_ns) / 1000;
    frame.age_us[i] = static_cast<std::int32_t>(
        std::min<std::int64_t>(age_us, std::numeric_limits<std::int32_t>::max()));
  }
}

void FaultyDriver::change(Entry& entry, const Occurrence& occurrence, Frame& frame) {
  if (entry.fault.kind == FaultKind::stick) return stick(entry, occurrence, frame);
  const double amount = entry.fault.amount;
  bool changed = false;
  for (const Channel channel : all_channels) {
    if (!entry.affects(channel, frame)) continue;
    const std::size_t i = index_of(channel);
    double& value = frame.value[i];
    const double before = value;
    switch (entry.fault.kind) {
      case FaultKind::drift:
        value += amount * (static_cast<double>(now_ns_ - occurrence.begin_ns) * 1.0e-9);
        break;
      case FaultKind::noise:
        value += amount * entry.chance.normal(account_.taken - 1, i);
        break;
      case FaultKind::saturate:
        value = std::clamp(value, -amount, amount);
        break;
      default:
        value = std::numeric_limits<double>::quiet_NaN();
    }
    changed = changed || !(value == before);
  }
  if (changed) hit(entry);
}

/// Holds the first value of an occurrence to its end.
void FaultyDriver::stick(Entry& entry, const Occurrence& occurrence, Frame& frame) {
  if (entry.held_in != occurrence.number + 1) {
    entry.held_in = occurrence.number + 1;
    entry.held = 0;
  }
  bool any = false;
  for (const Channel channel : all_channels) {
    if (!entry.affects(channel, frame)) continue;
    const std::size_t i = index_of(channel);
    const unsigned bit = 1U << i;
    if ((entry.held & bit) == 0) entry.value[i] = frame.value[i];
    entry.held = static_cast<std::uint8_t>(entry.held | bit);
    frame.value[i] = entry.value[i];
    any = true;
  }
  if (any) hit(entry);
}

// Writing, and digital inputs.

Result FaultyDriver::write(const Actuation& actuation) {
  ++writes_;
  if (unplugged_by_ != nullptr) {
    hit(*unplugged_by_);
    return still_unplugged();
  }
  if (to_be_started_) {
    if (!actuation.amplifier_on) return device_->write(actuation);
    return {Outcome::fatal, "write to a device that was unplugged, not started"};
  }
  if (!running_) return device_->write(actuation);
  for (Entry& entry : entries_) {
    if (entry.fault.kind != FaultKind::write_error || !active_occurrence(entry, now_ns_)) continue;
    if (!entry.chance.hits(entry.fault.probability, writes_)) continue;
    hit(entry);
    if (!actuation.amplifier_on) device_->write(actuation);
    return {Outcome::temporary, entry.message.c_str()};
  }
  return device_->write(actuation);
}

void FaultyDriver::update_lines() {
  lines_ = {};
  for (Entry& entry : entries_) {
    const FaultKind kind = entry.fault.kind;
    const bool stop = kind == FaultKind::emergency_stop;
    const bool differs = kind == FaultKind::output_differs;
    if (!stop && !differs && kind != FaultKind::amplifier_fault) continue;
    if (!active_occurrence(entry, now_ns_)) continue;
    hit(entry);
    if (stop) lines_.emergency_stop = true;
    if (differs) lines_.differing_output = {.name = entry.message.c_str(), .unit = nullptr};
    if (kind == FaultKind::amplifier_fault) lines_.amplifier_fault = true;
  }
}

// Counters.

FrameAccount FaultyDriver::account() const {
  FrameAccount out = account_;
  out.waiting = queued_;
  if (overtaken_) out.waiting += overtaken_twice_ ? 2 : 1;
  return out;
}

std::optional<Occurrence> FaultyDriver::active_occurrence(Entry& entry, std::int64_t time_ns) {
  auto occurrence = entry.timeline.at(time_ns);
  if (occurrence && entry.counted != occurrence->number + 1) {
    entry.counted = occurrence->number + 1;
    ++applied_[entry.position].occurrences;
  }
  return occurrence;
}

void FaultyDriver::hit(const Entry& entry) {
  Applied& applied = applied_[entry.position];
  if (applied.hits++ == 0) applied.first_ns = now_ns_;
  applied.last_ns = now_ns_;
}

}  // namespace stickslip::drivers
