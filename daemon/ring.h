// A queue between two threads: one writer, one reader, neither ever waits, and no
// memory is asked for after construction.
#pragma once

#include <readerwriterqueue/readerwriterqueue.h>

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace stickslip::daemon {

template <class T>
class Ring {
 public:
  /// `room` > 0: how many it holds, exactly.
  explicit Ring(std::size_t room) : room_(room), queue_(room) {}

  /// Writer only; false where it is full.
  bool push(const T& value) {
    if (!has_room() || !queue_.try_enqueue(value)) return false;
    pushed_.store(pushed_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
    return true;
  }

  /// Writer only: whether the next push will be taken.
  bool has_room() const {
    const std::uint64_t pushed = pushed_.load(std::memory_order_relaxed);
    if (pushed - popped_seen_ < room_) return true;
    popped_seen_ = popped_.load(std::memory_order_acquire);
    return pushed - popped_seen_ < room_;
  }

  /// Reader only: the oldest, or null. Valid until it is popped.
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
  std::size_t room_;
  moodycamel::ReaderWriterQueue<T> queue_;
  // They make the room exact, and order the slots for everyone who reads this code, the thread
  // sanitizer included, which cannot see the fences by which the queue orders them too.
  // Each side asks for the other's counter only when what it saw of it last is used up: fetching it
  // from another core at every frame costs more than all the rest.
  alignas(64) std::atomic<std::uint64_t> pushed_{0};
  mutable std::uint64_t popped_seen_ = 0;  // the writer's
  alignas(64) std::atomic<std::uint64_t> popped_{0};
  mutable std::uint64_t pushed_seen_ = 0;  // the reader's
};

}  // namespace stickslip::daemon
