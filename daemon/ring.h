// SPDX-License-Identifier: Apache-2.0
// Queue between two threads: one writer, one reader, neither ever waits, and no memory is
// allocated after construction.
#pragma once

#include <readerwriterqueue/readerwriterqueue.h>

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace stickslip::daemon {

template <class T>
class Ring {
 public:
  /// `capacity` > 0: exact number of elements.
  explicit Ring(std::size_t capacity) : capacity_(capacity), queue_(capacity) {}

  /// Writer only; false if full.
  bool push(const T& value) {
    if (full() || !queue_.try_enqueue(value)) return false;
    pushed_.store(pushed_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
    return true;
  }

  /// Writer only.
  bool full() const {
    const std::uint64_t pushed = pushed_.load(std::memory_order_relaxed);
    if (pushed - popped_seen_ < capacity_) return false;
    popped_seen_ = popped_.load(std::memory_order_acquire);
    return pushed - popped_seen_ >= capacity_;
  }

  /// Reader only: the oldest element, or null. Valid until it is popped.
  const T* front() const {
    const std::uint64_t popped = popped_.load(std::memory_order_relaxed);
    if (pushed_seen_ == popped) {
      pushed_seen_ = pushed_.load(std::memory_order_acquire);
      if (pushed_seen_ == popped) return nullptr;
    }
    return queue_.peek();
  }

  /// Reader only, after a `front` that was not null.
  void pop() {
    queue_.pop();
    popped_.store(popped_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }

  std::size_t size() const {
    const std::uint64_t popped = popped_.load(std::memory_order_acquire);
    return pushed_.load(std::memory_order_acquire) - popped;
  }

 private:
  std::size_t capacity_;
  moodycamel::ReaderWriterQueue<T> queue_;
  // The counters make the capacity exact, and order the slots for the thread sanitizer too, which
  // does not see the fences inside the queue. Each side keeps the last value it saw of the other's
  // counter and fetches it only when that is used up: a cache line moved between cores for every
  // frame costs more than everything else.
  alignas(64) std::atomic<std::uint64_t> pushed_{0};
  mutable std::uint64_t popped_seen_ = 0;  // the writer's
  alignas(64) std::atomic<std::uint64_t> popped_{0};
  mutable std::uint64_t pushed_seen_ = 0;  // the reader's
};

}  // namespace stickslip::daemon
