// SPDX-License-Identifier: Apache-2.0
// Conversion of LCM messages to messages for pages, with the state that a new page needs.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "physics/frame.h"
#include "tools/scope/history.h"
#include "tools/scope/message.h"
#include "tools/scope/wire.h"

namespace stickslip::scope {

struct FeedSettings {
  std::string version = {};  ///< of the program
  std::string url = {};      ///< LCM URL
  double history_s = 60.0;   ///< length of the history that a new page gets
  /// Limit of its size: a minute at 1 kHz takes 4 MB.
  std::size_t history_max_bytes = std::size_t{256} << 20U;
  bool notes = false;  ///< pages may write notes
  std::vector<Mark> marks =
      {};  ///< of a model given by option; else from the recording's description
};

/// Converts LCM messages to messages for pages. Input is not trusted: messages that cannot be
/// decoded are counted and dropped. Not thread-safe.
class LiveFeed {
 public:
  using Clock = std::chrono::steady_clock;
  using Send = std::function<void(const SharedMessage&)>;

  /// `send` is called with each message for all connected pages.
  LiveFeed(FeedSettings settings, Send send);

  /// Accepts one LCM message. `received_unix_ms`: time of receipt [ms since 1970, UTC].
  void take(std::string_view channel, std::span<const std::uint8_t> bytes, double received_unix_ms,
            Clock::time_point now);

  /// To be called about every 0.1 s: reports that the source has stopped, and that this server has
  /// not.
  void tick(Clock::time_point now);

  /// The first messages for a new page, in this order.
  std::vector<SharedMessage> greeting(Clock::time_point now) const;

  /// Frames are arriving.
  bool connected() const { return connected_; }
  /// Name of the rig; empty until it is known.
  const std::string& rig() const { return rig_; }
  std::uint64_t frames() const { return frames_taken_; }
  std::uint64_t undecoded() const { return undecoded_; }

 private:
  void take_block(std::span<const std::uint8_t> bytes, double received_unix_ms,
                  Clock::time_point now);
  void take_excitation(std::span<const std::uint8_t> bytes);
  void take_event(std::span<const std::uint8_t> bytes);
  void take_description(std::span<const std::uint8_t> bytes);
  bool is_restart(const Frame& next) const;
  void reset_run();
  SharedMessage alive(Clock::time_point now) const;
  double silence_s(Clock::time_point now) const;
  void send(SharedMessage message);

  FeedSettings settings_;
  Send send_;
  std::string rig_;
  SharedMessage hello_;
  SharedMessage model_;  ///< like those below, the latest or null
  SharedMessage estimate_;
  SharedMessage status_;
  SharedMessage timing_;
  SharedMessage recorder_;
  struct Verdict {
    std::string code;
    SharedMessage event;
  };
  std::vector<Verdict> verdicts_;    ///< the model check's latest event of each kind, oldest first
  std::deque<SharedMessage> notes_;  ///< the latest, oldest first
  FrameHistory history_;
  FrameTimes times_;
  std::vector<Frame> frames_;
  std::optional<Frame> last_;
  std::optional<Clock::time_point> last_block_at_;  ///< time of the latest block
  std::optional<Clock::time_point> status_at_;      ///< time of the latest status
  Clock::time_point alive_at_;                      ///< time of the latest heartbeat
  Clock::time_point began_;
  bool connected_ = false;
  std::uint64_t frames_taken_ = 0;
  std::uint64_t undecoded_ = 0;
};

}  // namespace stickslip::scope
