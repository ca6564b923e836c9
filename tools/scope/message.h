// SPDX-License-Identifier: Apache-2.0
// A message to the pages, encoded once and shared by all recipients.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

namespace stickslip::scope {

/// Handling of a message to a client that is too slow.
enum class Keep {
  may_be_lost,  ///< telemetry: superseded by the next
  always,       ///< changes the state of a page: model, restart, event
};

/// The payload of a WebSocket message, with headroom for the header, which the server writes in
/// place and which is the same for every client.
class Message {
 public:
  static constexpr std::size_t headroom = 32;

  /// A binary message of `size` bytes, all 0.
  explicit Message(std::size_t size)
      : bytes_(headroom + size, std::uint8_t{0}), binary_(true), keep_(Keep::may_be_lost) {}
  /// A text message, UTF-8.
  Message(std::string_view text, Keep keep)
      : bytes_(headroom + text.size()), binary_(false), keep_(keep) {
    std::copy(text.begin(), text.end(), payload().begin());
  }

  std::span<std::uint8_t> payload() { return std::span(bytes_).subspan(headroom); }
  std::span<const std::uint8_t> payload() const { return std::span(bytes_).subspan(headroom); }
  std::size_t size() const { return bytes_.size() - headroom; }
  bool binary() const { return binary_; }
  Keep keep() const { return keep_; }

 private:
  std::vector<std::uint8_t> bytes_;
  bool binary_;
  Keep keep_;
};

/// Shared by the backlogs of all clients. The payload is immutable once shared; the header is
/// rewritten identically for each client by the server's thread.
using SharedMessage = std::shared_ptr<Message>;

template <class... Arguments>
SharedMessage shared_message(Arguments&&... arguments) {
  return std::make_shared<Message>(std::forward<Arguments>(arguments)...);
}

}  // namespace stickslip::scope
