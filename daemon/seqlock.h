// SPDX-License-Identifier: Apache-2.0
// Sequence lock: a value that one thread writes often and others read occasionally. The writer
// never waits; a reader that meets an unfinished write reads again.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace stickslip::daemon {

template <class T>
class SeqLock {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  SeqLock() { write(T{}); }

  /// One writer only.
  void write(const T& value) {
    std::array<std::uint64_t, words> buffer{};
    std::memcpy(buffer.data(), &value, sizeof value);
    const std::uint64_t odd = version_.load(std::memory_order_relaxed) + 1;
    version_.store(odd, std::memory_order_relaxed);
    // Stores of the words stay behind the odd version, a reader's loads before the even one.
    for (std::size_t i = 0; i < words; ++i) {
      words_[i].store(buffer[i], std::memory_order_release);
    }
    version_.store(odd + 1, std::memory_order_release);
  }

  /// Any other thread: a consistent copy.
  T read() const {
    std::array<std::uint64_t, words> buffer{};
    for (;;) {
      const std::uint64_t before = version_.load(std::memory_order_acquire);
      for (std::size_t i = 0; i < words; ++i) {
        buffer[i] = words_[i].load(std::memory_order_acquire);
      }
      if ((before & 1U) == 0 && version_.load(std::memory_order_relaxed) == before) break;
    }
    T value;
    std::memcpy(static_cast<void*>(&value), buffer.data(), sizeof value);
    return value;
  }

 private:
  static constexpr std::size_t words = (sizeof(T) + 7) / 8;
  std::atomic<std::uint64_t> version_{0};
  std::array<std::atomic<std::uint64_t>, words> words_{};
};

}  // namespace stickslip::daemon
