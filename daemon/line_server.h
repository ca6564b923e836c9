// SPDX-License-Identifier: Apache-2.0
// Text lines over a Unix socket, for untrusted clients: slow, silent, flooding or dead. One thread
// serves all of them and waits for none.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace stickslip::daemon {

/// Credentials of a client, from the kernel.
struct Peer {
  pid_t pid = 0;
  uid_t uid = 0;
  gid_t gid = 0;
};

struct LineServerSettings {
  std::filesystem::path path;
  std::string group;  ///< whose members may connect, besides root and the daemon's user; empty: the
                      ///< daemon's group
  std::size_t max_clients = 64;
  std::size_t max_line_bytes = std::size_t{64} * 1024;
  std::size_t max_unread_bytes = std::size_t{1} << 20;  ///< output that a client has not read
  std::size_t max_lines_per_turn = 64;                  ///< of all clients together
  std::chrono::nanoseconds timeout = std::chrono::seconds(10);  ///< for an unfinished line
};

/// A socket at its path, on which clients may already wait. Claimed before anything that a second
/// daemon must not touch.
class ListeningSocket {
 public:
  /// Listens at the path, mode 0660. Replaces a stale socket. Throws InputError if another daemon
  /// listens there, naming its process, or the folder or the group does not exist.
  explicit ListeningSocket(const LineServerSettings& settings);
  ListeningSocket(ListeningSocket&& other) noexcept;
  ListeningSocket& operator=(ListeningSocket&&) = delete;
  ~ListeningSocket();

  int file() const { return file_; }
  gid_t group() const { return group_; }  ///< whose members may connect

 private:
  std::filesystem::path path_;
  int file_ = -1;
  gid_t group_ = 0;
  dev_t device_ = 0;  // of the socket's file, so that no other is removed
  ino_t inode_ = 0;
};

class LineServer {
 public:
  using ClientId = std::uint64_t;
  struct Handlers {
    std::function<void(ClientId, const Peer&)> joined;
    std::function<void(ClientId, std::string_view)> line;
    std::function<void(ClientId, const std::string& why)> left;
  };

  LineServer(ListeningSocket socket, const LineServerSettings& settings, Handlers handlers);
  ~LineServer();
  LineServer(const LineServer&) = delete;
  LineServer& operator=(const LineServer&) = delete;

  /// Serves clients after waiting for input, for `wait` at most or until the file `also` is
  /// readable. True if `also` is readable.
  bool serve(std::chrono::milliseconds wait, int also);

  /// Sends a line, adding its end. A client with too much unread output is dropped.
  void send(ClientId client, std::string_view line);

 private:
  struct Client {
    int file = -1;
    Peer peer;
    std::string in;
    std::string out;
    std::size_t sent = 0;
    std::chrono::steady_clock::time_point line_start;  // of the unfinished line
    std::chrono::steady_clock::time_point active;      // latest complete line
    bool closing = false;
    bool half_closed = false;  // sends no more, but may still read its answers
    bool hung_up = false;
    std::string reason;  // of its removal
  };

  bool poll_clients(std::chrono::milliseconds wait, int also);
  void serve_lines();
  void accept_clients();
  void admit(int file, const Peer& peer);
  bool is_allowed(const Peer& peer) const;
  void drop_longest_idle();
  void receive(Client& client);
  bool take_line(ClientId id, Client& client);
  void flush(Client& client);
  void drop_finished(std::chrono::steady_clock::time_point now);

  LineServerSettings settings_;
  Handlers handlers_;
  ListeningSocket listener_;
  std::map<ClientId, Client> clients_;
  ClientId next_ = 1;
  ClientId turn_ = 0;  // served last
};

}  // namespace stickslip::daemon
