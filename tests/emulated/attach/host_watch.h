// SPDX-License-Identifier: Apache-2.0
// Timing of the host during a test: tests in real time run in parallel with others, and on hosts
// that are suspended for short times.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>

namespace stickslip::emulated {

/// Measures the excess of periodic sleeps of half a millisecond. Tests extend their tolerances by
/// it, so that these stay small on a quiet host.
class HostWatch {
 public:
  HostWatch()
      : thread_([this] {
          while (!stopping_) measure();
        }) {}
  HostWatch(const HostWatch&) = delete;
  HostWatch& operator=(const HostWatch&) = delete;
  ~HostWatch() {
    stopping_ = true;
    thread_.join();
  }

  /// Longest delay of the host so far [ns], doubled, as other threads may have been delayed longer.
  std::int64_t worst_ns() const { return 2 * worst_ns_; }
  /// Total delay.
  std::chrono::nanoseconds lost() const { return std::chrono::nanoseconds(lost_ns_); }

 private:
  void measure() {
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

/// A duration, extended by delays of the host to at most five times its length.
class Interval {
 public:
  Interval(const HostWatch& host, std::chrono::nanoseconds length)
      : host_(host), length_(length), lost_(host.lost()) {}
  bool over() const {
    const auto more = std::min(2 * (host_.lost() - lost_), 4 * length_);
    return std::chrono::steady_clock::now() - start_ >= length_ + more;
  }

 private:
  const HostWatch& host_;
  std::chrono::nanoseconds length_;
  std::chrono::nanoseconds lost_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace stickslip::emulated
