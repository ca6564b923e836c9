#include "drivers/bench/gauge_reader.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace stickslip::drivers {

namespace {
constexpr std::size_t room = 4096;  // readings: seconds of the fastest bridge
}

GaugeReader::GaugeReader(std::unique_ptr<Gauge> gauge, Patience patience)
    : gauge_(std::move(gauge)), patience_(patience), told_(room), latest_(gauge_->inputs().size()) {
  const std::string& name = gauge_->name();
  sentences_[static_cast<std::size_t>(Condition::gone)] = name + " is gone; it is looked for";
  sentences_[static_cast<std::size_t>(Condition::needs_attention)] =
      name + " cannot be used as it is: `stickslip check --live` says why";
  sentences_[static_cast<std::size_t>(Condition::beyond_help)] =
      name + " cannot be brought back: restart the daemon once it is mended";
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
    condition_.store(Condition::here, std::memory_order_release);
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
  if (condition_.load(std::memory_order_relaxed) == Condition::here) keep_losses();
  gauge_->close();
  // The loop is not at work while this is closed.
  while (told_.peek() != nullptr) told_.pop();
  std::fill(latest_.begin(), latest_.end(), Reading{});
  condition_.store(Condition::gone, std::memory_order_release);
}

void GaugeReader::run() {
  const auto stopping = [this] {
    const std::lock_guard lock(mutex_);
    return stopping_;
  };
  std::int64_t wait_ns = patience_.first_ns;
  while (!stopping()) {
    if (condition_.load(std::memory_order_relaxed) == Condition::here) {
      if (!read_until_lost()) return;
      if (spoke_) wait_ns = patience_.first_ns;
      pause(wait_ns);
      wait_ns = std::min(2 * wait_ns, patience_.longest_ns);
      continue;
    }
    const Result opened = gauge_->open();
    if (opened) {
      condition_.store(Condition::here, std::memory_order_release);
      continue;
    }
    gauge_->close();
    const bool attention = opened.outcome == Outcome::needs_attention;
    condition_.store(attention ? Condition::needs_attention : Condition::gone,
                     std::memory_order_release);
    pause(wait_ns);
    wait_ns = std::min(2 * wait_ns, patience_.longest_ns);
  }
}

GaugeReader::Condition GaugeReader::condition_after(Outcome outcome) {
  switch (outcome) {
    case Outcome::fatal:
      return Condition::beyond_help;
    case Outcome::needs_attention:
      return Condition::needs_attention;
    default:
      return Condition::gone;
  }
}

/// False where there is nothing more to do: it is stopped, or beyond help.
bool GaugeReader::read_until_lost() {
  std::vector<Reading> readings(gauge_->inputs().size());
  std::vector<Reading> before = readings;
  spoke_ = false;
  for (;;) {
    {
      const std::lock_guard lock(mutex_);
      if (stopping_) return false;
    }
    const Result result = gauge_->read(readings);
    publish_losses();
    switch (result.outcome) {
      case Outcome::ok:
        spoke_ = true;
        for (std::size_t i = 0; i < readings.size(); ++i) {
          if (readings[i].time_ns != before[i].time_ns || readings[i].valid != before[i].valid) {
            tell(i, readings[i]);
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
        tell_lost(condition_after(result.outcome));
        return result.outcome != Outcome::fatal;
    }
  }
}

void GaugeReader::pause(std::int64_t ns) {
  std::unique_lock lock(mutex_);
  wake_.wait_for(lock, std::chrono::nanoseconds(ns), [this] { return stopping_; });
}

void GaugeReader::tell(std::size_t input, const Reading& reading) {
  // A loop that does not look has no use for it either.
  static_cast<void>(told_.try_enqueue({input, reading}));
}

/// What was said before is no longer believed once the gauge speaks again.
void GaugeReader::tell_lost(Condition condition) {
  condition_.store(condition, std::memory_order_release);
  for (std::size_t i = 0; i < gauge_->inputs().size(); ++i) tell(i, Reading{});
}

void GaugeReader::publish_losses() {
  const GaugeLosses losses = gauge_->losses();
  missing_.store(missing_before_ + losses.missing, std::memory_order_relaxed);
  rejected_.store(rejected_before_ + losses.rejected, std::memory_order_relaxed);
}

/// The gauge is about to be closed, and counts from 0 when it is opened again.
void GaugeReader::keep_losses() {
  publish_losses();
  missing_before_ = missing_.load(std::memory_order_relaxed);
  rejected_before_ = rejected_.load(std::memory_order_relaxed);
}

Reading GaugeReader::latest(std::size_t input, std::int64_t time_ns) {
  while (const Told* told = told_.peek()) {
    if (told->reading.time_ns > time_ns) break;
    latest_[told->input] = told->reading;
    told_.pop();
  }
  return latest_[input];
}

const char* GaugeReader::lost() const noexcept {
  const Condition condition = condition_.load(std::memory_order_acquire);
  if (condition == Condition::here) return nullptr;
  return sentences_[static_cast<std::size_t>(condition)].c_str();
}

GaugeLosses GaugeReader::losses() const noexcept {
  return {missing_.load(std::memory_order_relaxed), rejected_.load(std::memory_order_relaxed)};
}

}  // namespace stickslip::drivers
