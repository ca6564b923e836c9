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
constexpr std::size_t usual_columns = 80;  // where the terminal does not say

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

class Progress::Painter {
 public:
  explicit Painter(std::string what)
      : what_(std::move(what)), thread_([this](const std::stop_token& stop) { run(stop); }) {}

  void at(double share) noexcept {
    double before = share_.load(std::memory_order_relaxed);
    while (share > before &&
           !share_.compare_exchange_weak(before, share, std::memory_order_relaxed)) {
    }
  }
  void takes(double seconds) noexcept { takes_s_.store(seconds, std::memory_order_relaxed); }
  void say(std::string what) {
    const std::scoped_lock lock(mutex_);
    what_ = std::move(what);
  }

 private:
  Standing standing() const {
    Standing out;
    out.what = what_;
    const double share = share_.load(std::memory_order_relaxed);
    const double takes_s = takes_s_.load(std::memory_order_relaxed);
    if (takes_s > 0.0) {
      out.done = (now_s() - begun_s_) / takes_s;
    } else if (share >= 0.0) {
      out.done = share;
    }
    return out;
  }

  void run(const std::stop_token& stop) {
    ProgressLine line(begun_s_);
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
      woken_.wait_for(lock, stop, std::chrono::duration<double>(ProgressLine::period_s),
                      [] { return false; });
      if (stop.stop_requested() || !in_foreground(file)) continue;
      const std::size_t columns = columns_of(file);
      write(line.draw(now_s(), standing(), columns > 0 ? columns : usual_columns));
    }
    write(line.erase());
  }

  // What a terminal does not take is not worth an error.
  static void write(const std::string& text) {
    if (!text.empty()) [[maybe_unused]]
      const auto written = ::write(file, text.data(), text.size());
  }

  const double begun_s_ = now_s();
  std::mutex mutex_;
  std::condition_variable_any woken_;
  std::string what_;  // under the mutex
  std::atomic<double> share_{-1.0};
  std::atomic<double> takes_s_{0.0};
  std::jthread thread_;  // the last: it uses all of the above
};

Progress::Progress(std::string what) {
  const Abilities abilities = abilities_of(file);
  if (abilities.terminal && !abilities.dumb) painter_ = std::make_unique<Painter>(std::move(what));
}

Progress::~Progress() = default;

void Progress::at(double share) noexcept {
  if (painter_) painter_->at(share);
}

void Progress::at(std::size_t done, std::size_t all) noexcept {
  if (all > 0) at(static_cast<double>(done) / static_cast<double>(all));
}

void Progress::takes(double seconds) noexcept {
  if (painter_) painter_->takes(seconds);
}

void Progress::say(std::string what) {
  if (painter_) painter_->say(std::move(what));
}

void Progress::finish() noexcept { painter_.reset(); }

}  // namespace stickslip::terminal
