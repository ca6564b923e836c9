// SPDX-License-Identifier: Apache-2.0
// A command that waits for its reply: sent by one thread, answered in another.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace stickslip::drivers::labjack {

/// Commands that may be in progress simultaneously, one per slot.
enum class Slot : std::uint8_t { set_point, off, lines };
inline constexpr std::size_t slot_count = 3;

/// Progress of a command. A result is returned once: the next call returns `none`.
struct Progress {
  enum class Kind : std::uint8_t { none, in_progress, done, failed, timed_out };
  Kind kind = Kind::none;
  std::uint32_t verdict = 0;  ///< done, failed: as settled; its meaning is the board's
  std::int64_t sent_ns = 0;   ///< done, failed: when the command was sent
};

inline constexpr std::int64_t reply_timeout_ns = 250'000'000;

/// begin, withdraw and progress belong to the thread that sends.
class CommandSlot {
 public:
  /// `tag` identifies the reply.
  void begin(std::uint16_t tag, std::int64_t sent_ns) {
    sent_ns_.store(sent_ns, std::memory_order_relaxed);
    word_.store(word_of(Phase::waiting, tag), std::memory_order_release);
  }
  /// The command could not be sent.
  void withdraw() { word_.store(word_of(Phase::idle, 0), std::memory_order_release); }

  bool idle() const { return phase_of(word_.load(std::memory_order_acquire)) == Phase::idle; }
  bool waits_for(std::uint16_t tag) const {
    const std::uint64_t word = word_.load(std::memory_order_acquire);
    return phase_of(word) == Phase::waiting && tag_of(word) == tag;
  }
  std::int64_t sent_ns() const { return sent_ns_.load(std::memory_order_relaxed); }

  /// Without effect unless a command waits.
  void settle(bool done, std::uint32_t verdict) {
    std::uint64_t word = word_.load(std::memory_order_acquire);
    if (phase_of(word) != Phase::waiting) return;
    const Phase phase = done ? Phase::done : Phase::failed;
    word_.compare_exchange_strong(word, word_of(phase, tag_of(word), verdict));
  }

  Progress progress(std::int64_t now_ns) {
    std::uint64_t word = word_.load(std::memory_order_acquire);
    if (phase_of(word) == Phase::idle) return {};
    if (phase_of(word) == Phase::waiting) {
      if (now_ns - sent_ns() < reply_timeout_ns) return {Progress::Kind::in_progress, 0, 0};
      if (word_.compare_exchange_strong(word, word_of(Phase::idle, 0))) {
        return {Progress::Kind::timed_out, 0, 0};
      }
      // The reply arrived meanwhile, and `word` holds it.
    }
    withdraw();
    return {phase_of(word) == Phase::done ? Progress::Kind::done : Progress::Kind::failed,
            static_cast<std::uint32_t>(word >> 32U), sent_ns()};
  }

 private:
  // Phase, tag and verdict in one word, so that a reply and a time-out cannot both take effect.
  enum class Phase : std::uint8_t { idle, waiting, done, failed };
  static constexpr std::uint64_t word_of(Phase phase, std::uint16_t tag,
                                         std::uint32_t verdict = 0) {
    return static_cast<std::uint64_t>(phase) | static_cast<std::uint64_t>(tag) << 8U |
           static_cast<std::uint64_t>(verdict) << 32U;
  }
  static constexpr Phase phase_of(std::uint64_t word) { return static_cast<Phase>(word & 0xFFU); }
  static constexpr std::uint16_t tag_of(std::uint64_t word) {
    return static_cast<std::uint16_t>(word >> 8U & 0xFFFFU);
  }

  std::atomic<std::uint64_t> word_{0};
  std::atomic<std::int64_t> sent_ns_{0};
};

}  // namespace stickslip::drivers::labjack
