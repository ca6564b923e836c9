// Where every frame went. The daemon's promise is that nothing is lost without a line here:
//
//   produced = delivered + each named loss + pending        for every consumer, at any time
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

/// Why a frame did not reach a consumer's end.
enum class Loss : std::uint8_t {
  ring_full,     ///< the consumer was behind by more than its ring holds
  write_error,   ///< the network or the disk refused it
  encode_error,  ///< it could not be encoded
  shutdown,      ///< still waiting when the time to drain was over
};

inline constexpr std::size_t loss_count = 4;
inline constexpr std::array<std::string_view, loss_count> loss_names = {"ring full", "write error",
                                                                        "encode error", "shutdown"};

/// The books of one consumer, as numbers.
struct AccountBalance {
  bool enabled = false;         ///< a consumer that nobody asked for owes nothing
  std::uint64_t delivered = 0;  ///< handed to the network or the kernel without an error
  /// Of those, how many the disk has confirmed to have; nothing where it was not asked to.
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

  /// Frames on their way in `account`; negative where more left than ever came.
  std::int64_t pending(const AccountBalance& account) const;

  /// produced = delivered + losses in every enabled account. Only true at rest: call it when the
  /// consumers have stopped.
  bool is_closed() const;

  /// One line for each consumer, for a person.
  std::string text() const;

  friend bool operator==(const Balance&, const Balance&) = default;
};

/// The books of one consumer. Each counter has one writer; anyone may read.
class Account {
 public:
  /// Frames handed over to the network or the disk without an error.
  void deliver(std::uint64_t frames) { delivered_.fetch_add(frames, std::memory_order_release); }
  void lose(Loss loss, std::uint64_t frames) {
    lost_[static_cast<std::size_t>(loss)].fetch_add(frames, std::memory_order_release);
  }
  /// Frames delivered that the disk has confirmed; 0: it will be asked to.
  void confirm(std::uint64_t frames) {
    asked_to_confirm_.store(true, std::memory_order_relaxed);
    confirmed_.fetch_add(frames, std::memory_order_release);
  }
  /// Set before the first frame.
  void enable() { enabled_.store(true, std::memory_order_release); }
  AccountBalance balance() const;

 private:
  std::atomic<bool> enabled_{false};
  std::atomic<std::uint64_t> delivered_{0};
  std::atomic<bool> asked_to_confirm_{false};
  std::atomic<std::uint64_t> confirmed_{0};
  std::array<std::atomic<std::uint64_t>, loss_count> lost_{};
};

/// The daemon's books.
class Ledger {
 public:
  void produce() { produced_.fetch_add(1, std::memory_order_release); }
  Account& published() { return published_; }
  Account& recorded() { return recorded_; }

  /// Taken so that pending is never negative: what left is read before what came.
  Balance balance() const;

 private:
  alignas(64) std::atomic<std::uint64_t> produced_{0};
  alignas(64) Account published_;
  alignas(64) Account recorded_;
};

}  // namespace stickslip::daemon
