// One message to the pages, encoded once and shared by all who get it.
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

/// What becomes of a message when a client is too slow for it.
enum class Keep {
  may_be_lost,  ///< telemetry: the next one says more
  always,       ///< changes what a page believes: model, restart, event
};

/// The payload of a WebSocket message. In front of it there is room for the header, which the
/// server writes in place; it is the same for every client.
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

/// Shared by the backlogs of all clients. Nobody changes a payload once it has been handed out; the
/// header in front of it is written again, alike, for each client, always by the server's thread.
using SharedMessage = std::shared_ptr<Message>;

template <class... Arguments>
SharedMessage shared_message(Arguments&&... arguments) {
  return std::make_shared<Message>(std::forward<Arguments>(arguments)...);
}

}  // namespace stickslip::scope
