// SPDX-License-Identifier: Apache-2.0
// Account of every frame. Nothing is lost without an entry here:
//
//   produced = delivered + losses by cause + pending        for every consumer, at any time
//
// and pending is 0 once the daemon has stopped.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace stickslip::daemon {

/// Why a frame was not delivered.
enum class Loss : std::uint8_t {
  ring_full,     ///< the consumer fell behind by more than its ring holds
  write_error,   ///< refused by the network or the disk
  encode_error,  ///< it could not be encoded
  shutdown,      ///< still queued at the end of the time to drain
};

inline constexpr std::size_t loss_count = 4;
inline constexpr std::array<std::string_view, loss_count> loss_names = {"ring full", "write error",
                                                                        "encode error", "shutdown"};

/// The account of one consumer at one moment.
struct AccountBalance {
  bool enabled = false;         ///< false: there is no such consumer
  std::uint64_t delivered = 0;  ///< accepted by the network or the kernel
  /// Of those, frames confirmed on disk; empty without syncs.
  std::optional<std::uint64_t> confirmed = {};
  std::array<std::uint64_t, loss_count> lost{};

  std::uint64_t lost_in_total() const;
  std::uint64_t lost_to(Loss loss) const { return lost[static_cast<std::size_t>(loss)]; }
  friend bool operator==(const AccountBalance&, const AccountBalance&) = default;
};

/// The whole ledger at one moment.
struct Balance {
  std::uint64_t produced = 0;  ///< frames that the driver yielded
  AccountBalance published;
  AccountBalance recorded;

  /// Frames on their way in `account`; negative if more left than came.
  std::int64_t pending(const AccountBalance& account) const;

  /// produced = delivered + losses in every enabled account. Valid once the consumers have stopped.
  bool is_closed() const;

  /// One line for each consumer.
  std::string text() const;

  friend bool operator==(const Balance&, const Balance&) = default;
};

/// The account of one consumer. Each counter has one writer and any number of readers.
class Account {
 public:
  void deliver(std::uint64_t frames) { delivered_.fetch_add(frames, std::memory_order_release); }
  void lose(Loss loss, std::uint64_t frames) {
    lost_[static_cast<std::size_t>(loss)].fetch_add(frames, std::memory_order_release);
  }
  /// Delivered frames confirmed on disk; 0 announces that there will be syncs.
  void confirm(std::uint64_t frames) {
    confirms_.store(true, std::memory_order_relaxed);
    confirmed_.fetch_add(frames, std::memory_order_release);
  }
  /// Before the first frame.
  void enable() { enabled_.store(true, std::memory_order_release); }
  AccountBalance balance() const;

 private:
  std::atomic<bool> enabled_{false};
  std::atomic<std::uint64_t> delivered_{0};
  std::atomic<bool> confirms_{false};
  std::atomic<std::uint64_t> confirmed_{0};
  std::array<std::atomic<std::uint64_t>, loss_count> lost_{};
};

class Ledger {
 public:
  void produce() { produced_.fetch_add(1, std::memory_order_release); }
  Account& published() { return published_; }
  Account& recorded() { return recorded_; }

  /// Reads the deliveries before the production, so that pending is never negative.
  Balance balance() const;

 private:
  alignas(64) std::atomic<std::uint64_t> produced_{0};
  alignas(64) Account published_;
  alignas(64) Account recorded_;
};

}  // namespace stickslip::daemon
