// SPDX-License-Identifier: Apache-2.0
// The connections of the web server and their stages, without a network.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "tools/scope/backlog.h"

struct lws;  // a connection of libwebsockets

namespace stickslip::scope {

using Clock = std::chrono::steady_clock;

enum class Stage {
  requesting,  ///< request incomplete
  answering,   ///< a file is being sent
  streaming,
};

/// One accepted connection.
struct Connection {
  Connection(std::string from, std::size_t backlog_bytes, Clock::time_point now)
      : peer(std::move(from)), since(now), backlog(backlog_bytes) {}

  void enter(Stage next, Clock::time_point now) {
    stage = next;
    since = now;
  }

  std::string peer;  ///< its address, without a port
  Stage stage = Stage::requesting;
  Clock::time_point since;   ///< of the stage
  Backlog backlog;           ///< streaming
  std::string wanted;        ///< streaming: the source that the page named; empty: none
  std::uint64_t stream = 0;  ///< streaming: its number
  std::string heard;         ///< streaming: the beginning of a text from the page
  std::string body;          ///< answering: the unsent rest begins at `sent`
  std::size_t sent = 0;
};

/// Time limits of the stages.
struct TimeLimits {
  Clock::duration request;
  Clock::duration answer;
  Clock::duration losing;  ///< a stream that loses messages without catching up
};

class Connections {
 public:
  using Map = std::unordered_map<lws*, Connection>;

  void add(lws* wsi, Connection connection);
  /// Null if unknown.
  Connection* find(lws* wsi);
  void erase(lws* wsi);

  /// Number of streams, and of other connections; of one address, or of all (null).
  std::size_t streams(const std::string* peer = nullptr) const;
  std::size_t requests(const std::string* peer = nullptr) const;

  /// The oldest connection without a complete request; null if there is none.
  lws* oldest_request(const std::string* peer = nullptr) const;

  /// Connections that exceed the limit of their stage.
  std::vector<lws*> overdue(const TimeLimits& limits, Clock::time_point now) const;

  Map::iterator begin() { return map_.begin(); }
  Map::iterator end() { return map_.end(); }

 private:
  Map map_;
};

}  // namespace stickslip::scope
