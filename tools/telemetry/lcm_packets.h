// SPDX-License-Identifier: Apache-2.0
// LCM's multicast packets with their senders, not named by LCM's own interface: programs
// that publish on the same channels are distinguished by them.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

namespace stickslip::telemetry {

struct LcmMessage {
  std::string sender;  ///< address and port, "127.0.0.1:40123": one for each program that publishes
  std::string channel;
  std::vector<std::uint8_t> bytes;
  double received_unix_ms = 0.0;  ///< [ms since 1970, UTC]
};

/// Assembles messages from packets, which are not trusted: a message is one packet, or fragments of
/// which the first begins with the channel's name.
class PacketAssembler {
 public:
  static constexpr std::size_t max_message_bytes = std::size_t{16} << 20U;
  static constexpr std::size_t max_senders = 64;  ///< with an incomplete message

  /// The message that this packet completes, if any.
  std::optional<LcmMessage> take(std::span<const std::uint8_t> packet, const std::string& sender);

  std::uint64_t malformed() const { return malformed_; }

 private:
  struct Parts {
    std::uint32_t number = 0;
    std::set<std::uint32_t> missing;
    std::string channel;
    std::vector<std::uint8_t> bytes;
  };

  std::optional<LcmMessage> take_fragment(std::span<const std::uint8_t> packet,
                                          const std::string& sender);

  std::map<std::string, Parts> incomplete_;  ///< by sender, who sends one message at a time
  std::uint64_t malformed_ = 0;
};

/// Receives the messages of a multicast group in a thread of its own.
class LcmReceiver {
 public:
  /// `url`: udpm, checked by join_lcm before. Throws InputError if the group cannot be joined.
  explicit LcmReceiver(const std::string& url);
  ~LcmReceiver();
  LcmReceiver(const LcmReceiver&) = delete;
  LcmReceiver& operator=(const LcmReceiver&) = delete;

  /// Readable while messages wait.
  int file() const;

  /// The messages that wait, oldest first.
  std::vector<LcmMessage> take();

 private:
  class Thread;
  std::unique_ptr<Thread> thread_;
};

}  // namespace stickslip::telemetry
