// SPDX-License-Identifier: Apache-2.0
#include "daemon/model_check.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <utility>

namespace stickslip::daemon {

namespace {

using diagnosis::LiveCheck;
using diagnosis::LiveStatus;

constexpr auto every_ns = static_cast<std::int64_t>(1.0e9 * LiveCheck::every_s);
constexpr auto kept_ns =
    static_cast<std::int64_t>(1.0e9 * (LiveCheck::span_s + LiveCheck::every_s));
// After a check the thread rests for so many times as long.
constexpr int rests = 3;
// Of the thread, against everything else in the system.
constexpr int niceness = 10;

std::int64_t utc_now_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::string seconds_text(std::int64_t time_ns) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1f s",
                std::max(0.0, 1.0e-9 * static_cast<double>(time_ns)));
  return text.data();
}

std::string time_of_day(std::int64_t utc_us) {
  const std::int64_t second = utc_us / 1'000'000 % 86400;
  std::array<char, 16> clock{};
  std::snprintf(clock.data(), clock.size(), "%02d:%02d:%02d", static_cast<int>(second / 3600),
                static_cast<int>(second / 60 % 60), static_cast<int>(second % 60));
  return clock.data();
}

}  // namespace

Event status_event(const LiveVerdict& verdict, std::int64_t now_ns, std::int64_t utc_us) {
  Event out;
  out.time_ns = now_ns;
  out.message = words_for(verdict);
  if (verdict.status != LiveStatus::broken) {
    out.code = "model_follows";
    out.message += " again";
    return out;
  }
  out.code = "model_broken";
  out.severity = Severity::warning;
  const std::int64_t since_us = utc_us - (now_ns - verdict.since_ns) / 1000;
  out.message += ", since " + time_of_day(since_us) + " UTC; diagnose the recording from " +
                 seconds_text(verdict.from_ns()) + " to " + seconds_text(verdict.to_ns()) +
                 " of its time_ns";
  return out;
}

Event explanation_event(const LiveVerdict& verdict, std::int64_t now_ns) {
  Event out;
  out.severity = Severity::warning;
  out.time_ns = now_ns;
  out.code = verdict.is_certain ? "model_explained" : "model_unexplained";
  out.message = cause_in_words(verdict);
  return out;
}

ModelCheck::ModelCheck(const physics::Model& model, double days_between_false_alarms,
                       std::optional<std::chrono::steady_clock::duration> patience)
    : days_between_false_alarms_(days_between_false_alarms), patience_(patience) {
  begin_with(model);
  thread_ = std::thread([this] { run(); });
}

void ModelCheck::begin_with(const physics::Model& model) {
  check_.emplace(
      model, diagnosis::LiveCheckSettings{.days_between_false_alarms = days_between_false_alarms_,
                                          .stop = stop_.get_token()});
}

ModelCheck::~ModelCheck() { finish(); }

void ModelCheck::change_model(const physics::Model& model) {
  {
    const std::lock_guard lock(lock_);
    if (ending_) return;
    new_model_ = model;
    stop_.request_stop();
    frames_.clear();
    const std::uint64_t alarms = verdict_.alarms;
    verdict_ = {};
    verdict_.alarms = alarms;
  }
  wake_.notify_all();
}

std::optional<Event> ModelCheck::next_event() {
  const std::lock_guard lock(lock_);
  if (events_.empty()) return std::nullopt;
  Event out = std::move(events_.front());
  events_.pop_front();
  return out;
}

LiveVerdict ModelCheck::verdict() const {
  const std::lock_guard lock(lock_);
  return verdict_;
}

WriteResult ModelCheck::write_block(std::span<const Sample> block) {
  {
    const std::lock_guard lock(lock_);
    for (const Sample& sample : block) {
      // A replayed source may start again.
      if (!frames_.empty() && sample.frame.time_ns <= frames_.back().time_ns) {
        frames_.clear();
        checked_ns_ = 0;
      }
      frames_.push_back(sample.frame);
    }
    while (frames_.front().time_ns < frames_.back().time_ns - kept_ns) frames_.pop_front();
  }
  wake_.notify_one();
  return WriteResult::ok;
}

void ModelCheck::finish() {
  {
    std::unique_lock lock(lock_);
    ending_ = true;
    wake_.notify_all();
    const auto has_ended = [this] { return ended_; };
    if (patience_ && !wake_.wait_for(lock, *patience_, has_ended)) {
      gave_up_ = true;
      stop_.request_stop();
    }
  }
  if (thread_.joinable()) thread_.join();
}

// False at the end, with the last frames.
bool ModelCheck::wait_for_frames(std::vector<Frame>& frames) {
  std::unique_lock lock(lock_);
  const auto is_interrupted = [this] { return ending_ || new_model_.has_value(); };
  const auto has_frames = [this] {
    return !frames_.empty() && frames_.back().time_ns >= checked_ns_ + every_ns;
  };
  wake_.wait_until(lock, resting_until_, is_interrupted);
  wake_.wait(lock, [&] { return is_interrupted() || has_frames(); });
  while (new_model_) {
    take_new_model();
    wake_.wait(lock, [&] { return is_interrupted() || has_frames(); });
  }
  frames.assign(frames_.begin(), frames_.end());
  if (ending_ || frames.empty()) return false;
  checked_ns_ = frames.back().time_ns;
  return true;
}

// With the lock.
void ModelCheck::take_new_model() {
  stop_ = std::stop_source();
  if (gave_up_) stop_.request_stop();
  earlier_alarms_ += check_->verdict().alarms;
  begin_with(*new_model_);
  new_model_.reset();
  follows_is_new_ = true;
  checked_ns_ = 0;
}

void ModelCheck::publish(const Event& event) {
  show_verdict();
  const std::lock_guard lock(lock_);
  if (!new_model_) events_.push_back(event);
}

// Results about a model that is no longer the rig's are not shown.
void ModelCheck::show_verdict() {
  const std::lock_guard lock(lock_);
  if (new_model_) return;
  verdict_ = check_->verdict();
  verdict_.alarms += earlier_alarms_;
}

void ModelCheck::check(const std::vector<Frame>& frames) {
  const std::span<const Frame> latest = diagnosis::latest_span(frames);
  if (latest.empty()) return;
  const LiveStatus before = check_->verdict().status;
  const auto begin = std::chrono::steady_clock::now();
  const bool changed = check_->update(latest);
  rest(std::chrono::steady_clock::now() - begin);
  const std::int64_t now_ns = latest.back().time_ns;
  if (changed) report_change(before, now_ns);
  if (check_->wants_explanation()) {
    const bool first = check_->verdict().explanations.empty();
    check_->explain();
    if (first || check_->verdict().is_final) publish(explanation_event(check_->verdict(), now_ns));
  }
  show_verdict();
}

void ModelCheck::report_change(LiveStatus before, std::int64_t now_ns) {
  const LiveStatus now = check_->verdict().status;
  if (now == LiveStatus::waiting) return;
  const bool is_new = std::exchange(follows_is_new_, false) && now == LiveStatus::follows;
  if (!is_new && now == LiveStatus::follows && before != LiveStatus::broken) return;
  Event event = status_event(check_->verdict(), now_ns, utc_now_us());
  if (is_new) event.message = "the rig follows its new model";
  publish(event);
}

// A deviation is confirmed at once.
void ModelCheck::rest(std::chrono::steady_clock::duration checked) {
  const std::lock_guard lock(lock_);
  resting_until_ = std::chrono::steady_clock::now();
  if (!check_->is_suspicious()) resting_until_ += rests * checked;
}

void ModelCheck::run() {
  // Of this thread only, on Linux. Where it is refused, the check competes on equal terms.
  (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), niceness);
  std::vector<Frame> frames;
  try {
    while (!check_until_the_end(frames)) {
    }
  } catch (const std::exception& error) {
    publish({.severity = Severity::error,
             .code = "model_check_failed",
             .message = "the live model check has ended: " + std::string(error.what())});
  }
  const std::lock_guard lock(lock_);
  ended_ = true;
  wake_.notify_all();
}

// False where a new model interrupts it.
bool ModelCheck::check_until_the_end(std::vector<Frame>& frames) {
  try {
    while (wait_for_frames(frames)) check(frames);
    check_last(frames);
    return true;
  } catch (const diagnosis::Interrupted&) {
    // At the end the stretch to diagnose has been reported.
    const std::lock_guard lock(lock_);
    return gave_up_ || !new_model_;
  }
}

// A source may be faster than the checks. Twice, since a deviation is reported only when it is
// confirmed.
void ModelCheck::check_last(const std::vector<Frame>& frames) {
  if (frames.empty()) return;
  std::vector<Frame> earlier = frames;
  while (earlier.back().time_ns > frames.back().time_ns - every_ns && earlier.size() > 1) {
    earlier.pop_back();
  }
  check(earlier);
  check(frames);
}

}  // namespace stickslip::daemon
