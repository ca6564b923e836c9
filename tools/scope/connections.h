// Who is connected, what for and since when: the books of the web server, without a network.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "tools/scope/backlog.h"

struct lws;  // libwebsockets' connection; here only a name

namespace stickslip::scope {

using Clock = std::chrono::steady_clock;

enum class Stage {
  requesting,  ///< its request is not complete
  answering,   ///< it is being sent a file
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
  Clock::time_point since;  ///< of the stage
  Backlog backlog;          ///< streaming
  std::string body;         ///< answering: what is left to be sent begins at `sent`
  std::size_t sent = 0;
};

/// How long a connection may stay in each stage.
struct Patience {
  Clock::duration request;
  Clock::duration answer;
  Clock::duration losing;  ///< a stream that loses, without once catching up
};

class Connections {
 public:
  using Map = std::unordered_map<lws*, Connection>;

  void add(lws* wsi, Connection connection);
  /// Null where it is not known.
  Connection* find(lws* wsi);
  void erase(lws* wsi);

  /// How many are streams, and how many are none; of one address, or of all (null).
  std::size_t streams(const std::string* peer = nullptr) const;
  std::size_t requests(const std::string* peer = nullptr) const;

  /// Who has waited longest without a complete request; null where nobody does.
  lws* oldest_request(const std::string* peer = nullptr) const;

  /// Whose patience is at its end.
  std::vector<lws*> overdue(const Patience& patience, Clock::time_point now) const;

  Map::iterator begin() { return map_.begin(); }
  Map::iterator end() { return map_.end(); }

 private:
  Map map_;
};

}  // namespace stickslip::scope
