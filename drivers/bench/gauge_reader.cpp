// SPDX-License-Identifier: Apache-2.0
#include "drivers/bench/gauge_reader.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace stickslip::drivers {

namespace {
constexpr std::size_t capacity = 4096;  // readings: seconds of the fastest bridge
}

GaugeReader::GaugeReader(std::unique_ptr<Gauge> gauge, RetryDelay retry)
    : gauge_(std::move(gauge)),
      retry_(retry),
      updates_(capacity),
      latest_(gauge_->inputs().size()) {
  const std::string& name = gauge_->name();
  messages_[static_cast<std::size_t>(Condition::gone)] = name + " is disconnected; reopening it";
  messages_[static_cast<std::size_t>(Condition::needs_attention)] =
      name + " cannot be used: see `stickslip check --live`";
  messages_[static_cast<std::size_t>(Condition::unusable)] =
      name + " failed permanently: repair it and restart the daemon";
}

GaugeReader::~GaugeReader() { close(); }

Result GaugeReader::open(bool insist) {
  close();
  stopping_ = false;
  if (insist) {
    const Result opened = gauge_->open();
    if (!opened) {
      gauge_->close();
      return opened;
    }
    remark_ = gauge_->remark();
    condition_.store(Condition::open, std::memory_order_release);
  }
  thread_ = std::thread([this] { run(); });
  return {};
}

void GaugeReader::close() noexcept {
  if (thread_.joinable()) {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
    thread_.join();
  }
  if (condition_.load(std::memory_order_relaxed) == Condition::open) keep_losses();
  gauge_->close();
  // The loop does not read while this is closed, so the queue has no other consumer.
  while (updates_.peek() != nullptr) updates_.pop();
  std::fill(latest_.begin(), latest_.end(), Reading{});
  condition_.store(Condition::gone, std::memory_order_release);
}

void GaugeReader::run() {
  const auto stopping = [this] {
    const std::lock_guard lock(mutex_);
    return stopping_;
  };
  std::int64_t wait_ns = retry_.first_ns;
  while (!stopping()) {
    if (condition_.load(std::memory_order_relaxed) == Condition::open) {
      if (!read_until_lost()) return;
      if (delivered_) wait_ns = retry_.first_ns;
      wait(wait_ns);
      wait_ns = std::min(2 * wait_ns, retry_.longest_ns);
      continue;
    }
    const Result opened = gauge_->open();
    if (opened) {
      condition_.store(Condition::open, std::memory_order_release);
      continue;
    }
    gauge_->close();
    const bool attention = opened.outcome == Outcome::needs_attention;
    condition_.store(attention ? Condition::needs_attention : Condition::gone,
                     std::memory_order_release);
    wait(wait_ns);
    wait_ns = std::min(2 * wait_ns, retry_.longest_ns);
  }
}

GaugeReader::Condition GaugeReader::condition_after(Outcome outcome) {
  switch (outcome) {
    case Outcome::fatal:
      return Condition::unusable;
    case Outcome::needs_attention:
      return Condition::needs_attention;
    default:
      return Condition::gone;
  }
}

/// False if it was stopped, or the gauge cannot be used again.
bool GaugeReader::read_until_lost() {
  std::vector<Reading> readings(gauge_->inputs().size());
  std::vector<Reading> before = readings;
  delivered_ = false;
  for (;;) {
    {
      const std::lock_guard lock(mutex_);
      if (stopping_) return false;
    }
    const Result result = gauge_->read(readings);
    publish_losses();
    switch (result.outcome) {
      case Outcome::ok:
        delivered_ = true;
        for (std::size_t i = 0; i < readings.size(); ++i) {
          if (readings[i].time_ns != before[i].time_ns || readings[i].valid != before[i].valid) {
            publish(i, readings[i]);
          }
        }
        before = readings;
        break;
      case Outcome::no_data:
      case Outcome::temporary:
        break;
      case Outcome::end_of_data:
      case Outcome::lost:
      case Outcome::needs_attention:
      case Outcome::fatal:
        keep_losses();
        gauge_->close();
        publish_loss(condition_after(result.outcome));
        return result.outcome != Outcome::fatal;
    }
  }
}

void GaugeReader::wait(std::int64_t ns) {
  std::unique_lock lock(mutex_);
  wake_.wait_for(lock, std::chrono::nanoseconds(ns), [this] { return stopping_; });
}

void GaugeReader::publish(std::size_t input, const Reading& reading) {
  // When full, a loop that does not read has no use for the reading either.
  static_cast<void>(updates_.try_enqueue({input, reading}));
}

/// Invalidates earlier readings, so that they do not reappear when the gauge is reopened.
void GaugeReader::publish_loss(Condition condition) {
  condition_.store(condition, std::memory_order_release);
  for (std::size_t i = 0; i < gauge_->inputs().size(); ++i) publish(i, Reading{});
}

void GaugeReader::publish_losses() {
  const GaugeLosses losses = gauge_->losses();
  missing_.store(missing_before_ + losses.missing, std::memory_order_relaxed);
  rejected_.store(rejected_before_ + losses.rejected, std::memory_order_relaxed);
}

/// Before the gauge is closed, as it counts from 0 when it is reopened.
void GaugeReader::keep_losses() {
  publish_losses();
  missing_before_ = missing_.load(std::memory_order_relaxed);
  rejected_before_ = rejected_.load(std::memory_order_relaxed);
}

Reading GaugeReader::latest(std::size_t input, std::int64_t time_ns) {
  while (const Update* update = updates_.peek()) {
    if (update->reading.time_ns > time_ns) break;
    latest_[update->input] = update->reading;
    updates_.pop();
  }
  return latest_[input];
}

const char* GaugeReader::lost() const noexcept {
  const Condition condition = condition_.load(std::memory_order_acquire);
  if (condition == Condition::open) return nullptr;
  return messages_[static_cast<std::size_t>(condition)].c_str();
}

GaugeLosses GaugeReader::losses() const noexcept {
  return {missing_.load(std::memory_order_relaxed), rejected_.load(std::memory_order_relaxed)};
}

}  // namespace stickslip::drivers
