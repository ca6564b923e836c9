#include "drivers/bench/gauge_reader.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace stickslip::drivers {

namespace {
constexpr std::size_t room = 4096;  // readings: seconds of the fastest bridge
}

GaugeReader::GaugeReader(std::unique_ptr<Gauge> gauge, Patience patience)
    : gauge_(std::move(gauge)), patience_(patience), told_(room), past_(gauge_->inputs().size()) {
  const std::string& name = gauge_->name();
  sentences_[static_cast<std::size_t>(Condition::gone)] = name + " is gone; it is looked for";
  sentences_[static_cast<std::size_t>(Condition::needs_attention)] =
      name + " cannot be used as it is: `stickslip devices` says why";
  sentences_[static_cast<std::size_t>(Condition::beyond_help)] =
      name + " cannot be brought back: restart the daemon once it is mended";
}

GaugeReader::~GaugeReader() { close(); }

Result GaugeReader::open(bool insist) {
  close();
  stopping_ = false;
  const Result opened = gauge_->open();
  if (!opened) {
    gauge_->close();
    if (insist) return opened;
  }
  condition_.store(opened ? Condition::here : Condition::gone, std::memory_order_release);
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
  gauge_->close();
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
      wait_ns = patience_.first_ns;
    }
    pause(wait_ns);
    if (stopping()) return;
    const Result opened = gauge_->open();
    if (opened) {
      condition_.store(Condition::here, std::memory_order_release);
      continue;
    }
    gauge_->close();
    const bool attention = opened.outcome == Outcome::needs_attention;
    condition_.store(attention ? Condition::needs_attention : Condition::gone,
                     std::memory_order_release);
    wait_ns = std::min(2 * wait_ns, patience_.longest_ns);
  }
}

/// False where there is nothing more to do: it is stopped, or beyond help.
bool GaugeReader::read_until_lost() {
  std::vector<Reading> readings(gauge_->inputs().size());
  std::vector<Reading> before = readings;
  for (;;) {
    {
      const std::lock_guard lock(mutex_);
      if (stopping_) return false;
    }
    const Result result = gauge_->read(readings);
    publish_losses();
    switch (result.outcome) {
      case Outcome::ok:
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
      case Outcome::fatal: {
        const GaugeLosses losses = gauge_->losses();
        gauge_->close();
        missing_before_ += losses.missing;
        rejected_before_ += losses.rejected;
        const bool fatal = result.outcome == Outcome::fatal;
        condition_.store(fatal                                        ? Condition::beyond_help
                         : result.outcome == Outcome::needs_attention ? Condition::needs_attention
                                                                      : Condition::gone,
                         std::memory_order_release);
        return !fatal;
      }
    }
  }
}

void GaugeReader::pause(std::int64_t ns) {
  std::unique_lock lock(mutex_);
  wake_.wait_for(lock, std::chrono::nanoseconds(ns), [this] { return stopping_; });
}

void GaugeReader::tell(std::size_t input, const Reading& reading) {
  // A loop that does not look has no use for it either: what it finds then is what came first.
  static_cast<void>(told_.push({input, reading}));
}

void GaugeReader::publish_losses() {
  const GaugeLosses losses = gauge_->losses();
  missing_.store(missing_before_ + losses.missing, std::memory_order_relaxed);
  rejected_.store(rejected_before_ + losses.rejected, std::memory_order_relaxed);
}

Reading GaugeReader::latest(std::size_t input, std::int64_t time_ns) {
  while (const Told* told = told_.front()) {
    Past& past = past_[told->input];
    past.readings[past.count++ % history] = told->reading;
    told_.pop();
  }
  const Past& past = past_[input];
  const std::size_t known = std::min(past.count, history);
  for (std::size_t back = 1; back <= known; ++back) {
    const Reading& reading = past.readings[(past.count - back) % history];
    if (reading.time_ns <= time_ns) return reading;
  }
  return {};
}

const char* GaugeReader::lost() const noexcept {
  const Condition condition = condition_.load(std::memory_order_acquire);
  if (condition == Condition::here) return nullptr;
  return sentences_[static_cast<std::size_t>(condition)].c_str();
}

GaugeLosses GaugeReader::losses() const {
  return {missing_.load(std::memory_order_relaxed), rejected_.load(std::memory_order_relaxed)};
}

}  // namespace stickslip::drivers
