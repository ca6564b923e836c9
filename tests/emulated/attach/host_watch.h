// How far the host that runs a test can be trusted with time: tests that wait in real time run
// beside others, and on machines that stand still for a while.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>

namespace stickslip::emulated {

/// Sleeps for half a millisecond, again and again, and looks how long it took. What a test allows
/// for time grows by what is seen here, and stays small on a quiet host.
class HostWatch {
 public:
  HostWatch()
      : thread_([this] {
          while (!stopping_) look();
        }) {}
  HostWatch(const HostWatch&) = delete;
  HostWatch& operator=(const HostWatch&) = delete;
  ~HostWatch() {
    stopping_ = true;
    thread_.join();
  }

  /// For how long the host stood still at most, since this began [ns]. Other threads may have been
  /// hit harder: twice of it.
  std::int64_t worst_ns() const { return 2 * worst_ns_; }
  /// For how long it stood still in all.
  std::chrono::nanoseconds lost() const { return std::chrono::nanoseconds(lost_ns_); }

 private:
  void look() {
    const auto before = std::chrono::steady_clock::now();
    std::this_thread::sleep_for(std::chrono::microseconds(500));
    const std::chrono::nanoseconds took = std::chrono::steady_clock::now() - before;
    const std::int64_t late_ns = took.count() - 600'000;
    if (late_ns <= 0) return;
    worst_ns_ = std::max<std::int64_t>(worst_ns_, late_ns);
    lost_ns_ += late_ns;
  }

  std::atomic<bool> stopping_ = false;
  std::atomic<std::int64_t> worst_ns_ = 0;
  std::atomic<std::int64_t> lost_ns_ = 0;
  std::thread thread_;
};

/// So long, and longer by what the host stood still meanwhile, but no more than five times.
class Interval {
 public:
  Interval(const HostWatch& host, std::chrono::nanoseconds length)
      : host_(host), length_(length), lost_(host.lost()) {}
  bool over() const {
    const auto more = std::min(2 * (host_.lost() - lost_), 4 * length_);
    return std::chrono::steady_clock::now() - begun_ >= length_ + more;
  }

 private:
  const HostWatch& host_;
  std::chrono::nanoseconds length_;
  std::chrono::nanoseconds lost_;
  std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
};

}  // namespace stickslip::emulated
