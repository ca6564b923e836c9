// LCM's messages in, the pages' messages out, and what a page that joins later must know.
#pragma once

#include <chrono>
#include <cstdint>
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
  std::string version;      ///< of the program
  std::string url;          ///< where LCM is
  double history_s = 60.0;  ///< frames that a page gets on joining
  /// The most that this history may hold: a minute at 1 kHz takes 4 MB.
  std::size_t history_most_bytes = std::size_t{256} << 20U;
  std::vector<Mark> marks;  ///< of a model given by hand; else the recording's description says
};

/// Turns what LCM carries into messages for pages. It believes nobody: what does not decode is
/// counted and left out. Not for use by two threads at once.
class LiveFeed {
 public:
  using Clock = std::chrono::steady_clock;
  using Send = std::function<void(const SharedMessage&)>;

  /// `send` is called with each message for all pages that are there.
  LiveFeed(FeedSettings settings, Send send);

  /// One message of LCM. `received_unix_ms`: when LCM handed it over [ms since 1970, UTC].
  void take(std::string_view channel, std::span<const std::uint8_t> bytes, double received_unix_ms,
            Clock::time_point now);

  /// To be called about every 0.1 s: tells when the source has fallen silent.
  void look_at_the_time(Clock::time_point now);

  /// What a page that joins now is sent first, in this order.
  std::vector<SharedMessage> greeting(Clock::time_point now) const;

  std::uint64_t frames() const { return frames_taken_; }
  std::uint64_t undecoded() const { return undecoded_; }

 private:
  void take_block(std::span<const std::uint8_t> bytes, double received_unix_ms,
                  Clock::time_point now);
  void take_excitation(std::span<const std::uint8_t> bytes);
  void take_event(std::span<const std::uint8_t> bytes);
  void take_description(std::span<const std::uint8_t> bytes);
  bool begins_anew(const Frame& next) const;
  void forget_the_run();
  double silence_s(Clock::time_point now) const;
  void send(SharedMessage message);

  FeedSettings settings_;
  Send send_;
  SharedMessage hello_;
  SharedMessage model_;  ///< as those below: the latest, if there was one
  SharedMessage estimate_;
  SharedMessage status_;
  SharedMessage timing_;
  struct Verdict {
    std::string code;
    SharedMessage event;
  };
  std::vector<Verdict> verdicts_;  ///< the model check's latest event of each kind, oldest first
  FrameHistory history_;
  FrameTimes times_;
  std::vector<Frame> frames_;
  std::optional<Frame> last_;
  std::optional<Clock::time_point> heard_;  ///< the latest block
  Clock::time_point began_;
  bool connected_ = false;
  std::uint64_t frames_taken_ = 0;
  std::uint64_t undecoded_ = 0;
};

}  // namespace stickslip::scope
