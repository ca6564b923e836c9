// A queue between two threads: one writer, one reader, neither ever waits, and no
// memory is asked for after construction.
#pragma once

#include <readerwriterqueue/readerwriterqueue.h>

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace stickslip::drivers {

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

  /// Reader only: the oldest, or null. Valid until it is popped.
  const T* front() const { return size() == 0 ? nullptr : queue_.peek(); }

  /// Reader only, after a `front` that was not null.
  void pop() {
    queue_.pop();
    popped_.store(popped_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }

  std::size_t size() const {
    const std::uint64_t popped = popped_.load(std::memory_order_acquire);
    return pushed_.load(std::memory_order_acquire) - popped;
  }
  bool has_room() const { return size() < room_; }

 private:
  std::size_t room_;
  moodycamel::ReaderWriterQueue<T> queue_;
  // They make the room exact, and order the slots for everyone who reads this code, the thread
  // sanitizer included, which cannot see the fences by which the queue orders them too.
  alignas(64) std::atomic<std::uint64_t> pushed_{0};
  alignas(64) std::atomic<std::uint64_t> popped_{0};
};

}  // namespace stickslip::drivers
