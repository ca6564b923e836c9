// HTTP and WebSocket, by libwebsockets: the page's files, and the stream to all who have opened it.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "tools/scope/listener.h"
#include "tools/scope/message.h"
#include "tools/scope/request.h"

namespace stickslip::scope {

/// What the server lets others use of this machine.
struct ServerLimits {
  std::size_t streams = 64;              ///< open at once
  std::size_t streams_per_address = 32;  ///< of them, from one address
  std::size_t requests = 192;            ///< connections at once that are no streams
  std::size_t requests_per_address = 128;
  std::chrono::milliseconds request{5000};  ///< in which a request must be complete
  std::chrono::milliseconds answer{20000};  ///< in which a file must have been read
  std::chrono::milliseconds losing{30000};  ///< for which a stream may go on losing messages
  std::size_t backlog_bytes = 1U << 20U;    ///< that may wait for one stream
  std::size_t header_bytes = 4096;          ///< of one request
};

/// What happened since the start.
struct ServerCounts {
  std::uint64_t streams_opened = 0;
  std::uint64_t refused = 0;           ///< requests that were turned away
  std::uint64_t connections_shed = 0;  ///< closed for a limit of number or time
  std::uint64_t talkative = 0;         ///< streams closed since they sent data
  std::uint64_t too_slow = 0;          ///< streams closed since they went on losing
  std::uint64_t messages_lost = 0;     ///< by slow streams, all together
};

/// One thread, one loop: `run` waits for requests and for files that it was told to watch. It only
/// sends: what a stream's client sends closes it.
class WebServer {
 public:
  using Greeting = std::function<std::vector<SharedMessage>()>;

  /// `greeting` is asked for what a new stream gets first. `listener` must live as long as this.
  /// Throws std::runtime_error where libwebsockets cannot begin.
  WebServer(const Listener& listener, Admission admission, ServerLimits limits, Greeting greeting);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  /// Calls `readable` from `run` whenever `file` can be read. The file stays its owner's.
  void watch(int file, std::function<void()> readable);

  /// Calls `tick` from `run` every 0.1 s.
  void every_tick(std::function<void()> tick);

  /// To every open stream; from `run` only (that is, from what it calls).
  void send(const SharedMessage& message);

  /// Serves until `stop`. What a callback throws ends it and comes out here.
  void run();
  void stop();

  std::size_t streams() const;
  const ServerCounts& counts() const;

 private:
  class Loop;
  std::unique_ptr<Loop> loop_;
};

}  // namespace stickslip::scope
