// SPDX-License-Identifier: Apache-2.0
#include "tools/terminal/progress.h"

#include <unistd.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <thread>
#include <utility>

#include "tools/terminal/abilities.h"
#include "tools/terminal/progress_line.h"

namespace stickslip::terminal {

namespace {

constexpr int file = STDERR_FILENO;
constexpr std::size_t default_columns = 80;  // if the terminal does not report its width

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

class Progress::Painter {
 public:
  explicit Painter(std::string label)
      : label_(std::move(label)), thread_([this](const std::stop_token& stop) { run(stop); }) {}

  void at(double share) noexcept {
    double before = share_.load(std::memory_order_relaxed);
    while (share > before &&
           !share_.compare_exchange_weak(before, share, std::memory_order_relaxed)) {
    }
  }
  void set_duration(double seconds) noexcept {
    duration_s_.store(seconds, std::memory_order_relaxed);
  }
  void set_label(std::string label) {
    const std::scoped_lock lock(mutex_);
    label_ = std::move(label);
  }

 private:
  Status status() const {
    Status out;
    out.label = label_;
    const double share = share_.load(std::memory_order_relaxed);
    const double duration_s = duration_s_.load(std::memory_order_relaxed);
    if (duration_s > 0.0) {
      out.done = (now_s() - start_s_) / duration_s;
    } else if (share >= 0.0) {
      out.done = share;
    }
    return out;
  }

  void run(const std::stop_token& stop) {
    ProgressLine line(start_s_);
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
      woken_.wait_for(lock, stop, std::chrono::duration<double>(ProgressLine::period_s),
                      [] { return false; });
      if (stop.stop_requested() || !in_foreground(file)) continue;
      const std::size_t columns = columns_of(file);
      write(line.draw(now_s(), status(), columns > 0 ? columns : default_columns));
    }
    write(line.erase());
  }

  // A failure to write to the terminal is ignored.
  static void write(const std::string& text) {
    if (!text.empty()) [[maybe_unused]]
      const auto written = ::write(file, text.data(), text.size());
  }

  const double start_s_ = now_s();
  std::mutex mutex_;
  std::condition_variable_any woken_;
  std::string label_;  // guarded by the mutex
  std::atomic<double> share_{-1.0};
  std::atomic<double> duration_s_{0.0};
  std::jthread thread_;  // last, since it uses the members above
};

Progress::Progress(std::string label) {
  const Abilities abilities = abilities_of(file);
  if (abilities.terminal && !abilities.dumb) painter_ = std::make_unique<Painter>(std::move(label));
}

Progress::~Progress() = default;

void Progress::at(double share) noexcept {
  if (painter_) painter_->at(share);
}

void Progress::at(std::size_t done, std::size_t all) noexcept {
  if (all > 0) at(static_cast<double>(done) / static_cast<double>(all));
}

void Progress::set_duration(double seconds) noexcept {
  if (painter_) painter_->set_duration(seconds);
}

void Progress::set_label(std::string label) {
  if (painter_) painter_->set_label(std::move(label));
}

void Progress::finish() noexcept { painter_.reset(); }

}  // namespace stickslip::terminal
