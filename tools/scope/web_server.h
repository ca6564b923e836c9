// SPDX-License-Identifier: Apache-2.0
// HTTP and WebSocket server (libwebsockets): the page's files, and the stream to its clients.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/scope/listener.h"
#include "tools/scope/message.h"
#include "tools/scope/request.h"

namespace stickslip::scope {

/// Limits of the resources that clients can use.
struct ServerLimits {
  std::size_t streams = 64;              ///< open at once
  std::size_t streams_per_address = 32;  ///< from one address
  std::size_t requests = 192;            ///< other connections at once
  std::size_t requests_per_address = 128;
  std::chrono::milliseconds request{5000};  ///< time limit for a complete request
  std::chrono::milliseconds answer{20000};  ///< time limit for reading a file
  std::chrono::milliseconds losing{30000};  ///< time limit for a stream that loses messages
  std::size_t backlog_bytes = 1U << 20U;    ///< capacity of the backlog of a stream
  std::size_t header_bytes = 4096;          ///< of one request
};

/// Counts since the start.
struct ServerCounts {
  std::uint64_t streams_opened = 0;
  std::uint64_t refused = 0;           ///< rejected requests
  std::uint64_t connections_shed = 0;  ///< closed for a limit of number or time
  std::uint64_t talkative = 0;         ///< streams closed because they sent data
  std::uint64_t too_slow = 0;          ///< streams closed because they kept losing messages
  std::uint64_t messages_lost = 0;     ///< by all slow streams
};

/// One thread, one event loop: `run` waits for requests and watched files. Streams are send-only
/// unless `on_text` is set: data from a client closes its stream.
class WebServer {
 public:
  /// `wanted`: the source that a page names in the address of its stream; may be empty.
  using Greeting = std::function<std::vector<SharedMessage>(std::string_view wanted)>;
  using Wants = std::function<bool(std::string_view wanted)>;
  /// A stream, by a number that is not used again.
  using StreamId = std::uint64_t;
  /// A text from a page that sees the source `wanted`; false closes its stream.
  using OnText =
      std::function<bool(StreamId stream, std::string_view wanted, std::string_view text)>;
  struct Content {
    std::string_view content_type;
    std::string body;
  };
  /// Content besides the page's files; none for a path without.
  using Provide = std::function<std::optional<Content>(std::string_view path)>;

  /// `greeting` yields the first messages of a new stream. `listener` must outlive this object.
  /// Throws Failure if libwebsockets cannot start.
  WebServer(const Listener& listener, Admission admission, ServerLimits limits, Greeting greeting);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  /// Calls `readable` from `run` whenever `file` is readable. The caller keeps ownership of the
  /// file.
  void watch(int file, std::function<void()> readable);

  /// Calls `tick` from `run` every 0.1 s.
  void every_tick(std::function<void()> tick);

  /// Sends to every open stream for which `wants` holds; to be called from callbacks of `run` only.
  void send(const SharedMessage& message, const Wants& wants);
  void send(const SharedMessage& message) {
    send(message, [](std::string_view) { return true; });
  }

  /// Sends to one stream, if it is still open.
  void send_to(StreamId stream, const SharedMessage& message);

  /// Accepts texts of up to 2 KB from pages.
  void on_text(OnText take);
  void provide(Provide provide);

  /// Serves until `stop`. Rethrows exceptions of callbacks.
  void run();
  void stop();

  std::size_t streams() const;
  const ServerCounts& counts() const;

 private:
  class Loop;
  std::unique_ptr<Loop> loop_;
};

}  // namespace stickslip::scope
