// Lines over a Unix socket, from clients that nobody vouches for: slow, silent, flooding or dead.
// One thread serves them all and waits for none of them.
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

/// Who is at the other end, as the kernel knows it.
struct Peer {
  pid_t pid = 0;
  uid_t uid = 0;
  gid_t gid = 0;
};

struct LineServerSettings {
  std::filesystem::path path;
  std::string group;  ///< whose members may come, besides root and the daemon's own user; empty:
                      ///< the daemon's own group
  std::size_t most_clients = 64;
  std::size_t longest_line = std::size_t{64} * 1024;
  std::size_t most_waiting_bytes = std::size_t{1} << 20;  ///< of output that a client does not read
  std::size_t most_lines_a_turn = 64;                     ///< of all clients together
  std::chrono::nanoseconds patience = std::chrono::seconds(10);  ///< with a line that does not end
};

class LineServer {
 public:
  using ClientId = std::uint64_t;
  struct Events {
    std::function<void(ClientId, const Peer&)> joined;
    std::function<void(ClientId, std::string_view)> line;
    std::function<void(ClientId, const std::string& why)> left;
  };

  /// Listens at the path, mode 0660. A socket there that nobody listens at is replaced. Throws
  /// InputError where another daemon listens, the folder is not there, or the group is not known.
  LineServer(const LineServerSettings& settings, Events events);
  ~LineServer();
  LineServer(const LineServer&) = delete;
  LineServer& operator=(const LineServer&) = delete;

  /// Waits for something to do, at most for `wait` or until `also` can be read, and does it.
  /// Whether `also` can be read.
  bool serve(std::chrono::milliseconds wait, int also);

  /// Sends a line (its end is added). A client that does not read is dropped when too much waits.
  void send(ClientId client, std::string_view line);

 private:
  struct Client {
    int file = -1;
    Peer peer;
    std::string in;
    std::string out;
    std::size_t sent = 0;
    std::chrono::steady_clock::time_point begun;  // of the line that has not ended
    std::chrono::steady_clock::time_point heard;
    bool closing = false;
    bool ended = false;    // sends no more, but may still read its answers
    bool hung_up = false;  // does neither
    std::string why;
  };

  void accept_some();
  bool may_come(const Peer& peer) const;
  void make_room();
  void receive(Client& client);
  bool take_line(ClientId id, Client& client);
  void flush(Client& client);
  void drop_the_done(std::chrono::steady_clock::time_point now);

  LineServerSettings settings_;
  Events events_;
  int listener_ = -1;
  gid_t group_ = 0;
  dev_t device_ = 0;  // of the socket's file, so that another's is not removed
  ino_t inode_ = 0;
  std::map<ClientId, Client> clients_;
  ClientId next_ = 1;
  ClientId turn_ = 0;  // who was served last
};

}  // namespace stickslip::daemon
