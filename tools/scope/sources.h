// SPDX-License-Identifier: Apache-2.0
// The rigs that publish on the same channels, distinguished by their senders; a page sees one of
// them.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tools/scope/live_feed.h"

namespace stickslip::scope {

/// A feed for each sender. A page names the source that it wants; one that names none, or one that
/// is not there, sees the current source: the first that sends, until it is silent and another is
/// not. A sender at the address of a silent source takes its place, as a restarted daemon does.
/// One that was restarted at once does when its predecessor stays silent and is not known to be
/// another rig.
class Sources {
 public:
  using Clock = LiveFeed::Clock;
  /// Which pages a message is for, by what they want.
  using Wants = std::function<bool(std::string_view wanted)>;
  using Send = std::function<void(const SharedMessage&, const Wants&)>;
  static constexpr std::size_t most = 8;  ///< sources; messages of further ones are ignored

  Sources(FeedSettings settings, Send send);

  /// Accepts one LCM message. `sender`: "127.0.0.1:40123", or empty if unknown.
  void take(const std::string& sender, std::string_view channel,
            std::span<const std::uint8_t> bytes, double received_unix_ms, Clock::time_point now);

  /// To be called about every 0.1 s.
  void tick(Clock::time_point now);

  /// Name of the rig that such a page sees; empty until it is known.
  const std::string& rig(std::string_view wanted) const { return shown_for(wanted).feed->rig(); }

  /// The first messages for a page that wants this source.
  std::vector<SharedMessage> greeting(std::string_view wanted, Clock::time_point now) const;

 private:
  struct Source {
    std::vector<std::string> senders;  ///< the latest last, which is the source's name
    std::unique_ptr<LiveFeed> feed;
    Clock::time_point begun_at;  ///< time of the first message
    Clock::time_point heard_at;  ///< and of the latest

    bool has(std::string_view sender) const;
  };

  Source& add();
  Source* source_of(const std::string& sender, Clock::time_point now);
  const Source& shown_for(std::string_view wanted) const;
  void show(const Source& source, const Wants& pages, Clock::time_point now) const;
  void choose_current(Clock::time_point now);
  void replace_restarted(Clock::time_point now);
  void forget_silent(Clock::time_point now);
  SharedMessage list() const;
  void send_list_if_changed();

  FeedSettings settings_;
  Send send_;
  std::vector<std::unique_ptr<Source>> sources_;  ///< never empty
  const Source* current_ = nullptr;
  SharedMessage list_;  ///< as it was sent
};

}  // namespace stickslip::scope
