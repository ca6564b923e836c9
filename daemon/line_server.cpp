// SPDX-License-Identifier: Apache-2.0
#include "daemon/line_server.h"

#include <fcntl.h>
#include <grp.h>
#include <poll.h>
#include <pwd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "physics/problem.h"

namespace stickslip::daemon {
namespace {

using std::chrono::steady_clock;

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& message) {
  throw InputError(Problem{path.string(), 0, 0, message});
}

sockaddr_un address_of(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string name = path.string();
  if (name.size() >= sizeof address.sun_path) {
    refuse(path, "the path is too long for a socket: expected at most " +
                     std::to_string(sizeof address.sun_path - 1) + " bytes");
  }
  name.copy(address.sun_path, name.size());
  return address;
}

const sockaddr* as_socket_address(const sockaddr_un& address) {
  return reinterpret_cast<const sockaddr*>(&address);
}

/// "another daemon" with its process, if one listens at the address; else empty.
std::string listener_at(const sockaddr_un& address) {
  const int probe = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (probe < 0) return {};
  const bool answered = ::connect(probe, as_socket_address(address), sizeof address) == 0;
  const bool busy = !answered && errno == EAGAIN;  // a full queue has a listener
  ucred listener{};
  socklen_t size = sizeof listener;
  const bool known =
      answered && ::getsockopt(probe, SOL_SOCKET, SO_PEERCRED, &listener, &size) == 0;
  ::close(probe);
  if (!answered && !busy) return {};
  if (!known || listener.pid <= 0) return "another daemon";
  return "another daemon (process " + std::to_string(listener.pid) + ')';
}

gid_t group_named(const std::filesystem::path& path, const std::string& name) {
  if (name.empty()) return ::getegid();
  const ::group* const found = ::getgrnam(name.c_str());
  if (found == nullptr) {
    refuse(path, "there is no group \"" + name + "\" for the control socket");
  }
  return found->gr_gid;
}

bool is_member(uid_t uid, gid_t primary, gid_t wanted) {
  if (primary == wanted) return true;
  const ::passwd* const user = ::getpwuid(uid);
  if (user == nullptr) return false;
  std::array<gid_t, 256> groups{};
  int count = static_cast<int>(groups.size());
  ::getgrouplist(user->pw_name, user->pw_gid, groups.data(), &count);
  const auto end = groups.begin() + std::clamp(count, 0, static_cast<int>(groups.size()));
  return std::find(groups.begin(), end, wanted) != end;
}

}  // namespace

ListeningSocket::ListeningSocket(const LineServerSettings& settings) : path_(settings.path) {
  const sockaddr_un address = address_of(path_);
  group_ = group_named(path_, settings.group);
  struct stat existing {};
  if (::lstat(address.sun_path, &existing) == 0) {
    if (!S_ISSOCK(existing.st_mode)) refuse(path_, "exists and is not a socket");
    if (const std::string other = listener_at(address); !other.empty()) {
      refuse(path_, other +
                        " is listening there: stop it, or give this one another "
                        "control.socket (--control)");
    }
    ::unlink(address.sun_path);
  }
  file_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  // No client may connect before the mode is set.
  const mode_t previous_mask = ::umask(0177);
  const bool bound = file_ >= 0 && ::bind(file_, as_socket_address(address), sizeof address) == 0;
  const int error = errno;
  ::umask(previous_mask);
  if (!bound) {
    if (file_ >= 0) ::close(file_);
    refuse(path_, std::string("the control socket cannot be created: ") + std::strerror(error) +
                      "; does its folder exist, and may the daemon "
                      "write there?");
  }
  if (::stat(address.sun_path, &existing) == 0) {
    device_ = existing.st_dev;
    inode_ = existing.st_ino;
  }
  if ((!settings.group.empty() && ::chown(address.sun_path, static_cast<uid_t>(-1), group_) != 0) ||
      ::chmod(address.sun_path, 0660) != 0 || ::listen(file_, 64) != 0) {
    const int error = errno;
    ::close(file_);
    ::unlink(address.sun_path);
    refuse(path_, std::string("the control socket cannot be opened to group \"") + settings.group +
                      "\": " + std::strerror(error) + "; is the daemon's user a member of it?");
  }
}

ListeningSocket::ListeningSocket(ListeningSocket&& other) noexcept
    : path_(std::move(other.path_)),
      file_(std::exchange(other.file_, -1)),
      group_(other.group_),
      device_(other.device_),
      inode_(other.inode_) {}

ListeningSocket::~ListeningSocket() {
  if (file_ < 0) return;
  ::close(file_);
  struct stat existing {};
  if (::lstat(path_.c_str(), &existing) == 0 && existing.st_dev == device_ &&
      existing.st_ino == inode_) {
    ::unlink(path_.c_str());
  }
}

LineServer::LineServer(ListeningSocket socket, const LineServerSettings& settings,
                       Handlers handlers)
    : settings_(settings), handlers_(std::move(handlers)), listener_(std::move(socket)) {}

LineServer::~LineServer() {
  for (auto& [id, client] : clients_) ::close(client.file);
}

bool LineServer::serve(std::chrono::milliseconds wait, int also) {
  const bool also_readable = poll_clients(wait, also);
  serve_lines();
  drop_finished(steady_clock::now());
  return also_readable;
}

bool LineServer::poll_clients(std::chrono::milliseconds wait, int also) {
  std::vector<pollfd> files;
  std::vector<ClientId> ids;
  files.push_back({also, POLLIN, 0});
  files.push_back({listener_.file(), POLLIN, 0});
  bool pending = false;  // complete lines that were received and not handled yet
  for (auto& [id, client] : clients_) {
    const bool writes = client.sent < client.out.size();
    const bool reads =
        !client.closing && !client.half_closed && client.in.size() < settings_.max_line_bytes;
    files.push_back(
        {client.file, static_cast<short>((reads ? POLLIN : 0) | (writes ? POLLOUT : 0)), 0});
    ids.push_back(id);
    pending = pending || client.in.find('\n') != std::string::npos;
  }
  const int ready =
      ::poll(files.data(), files.size(), pending ? 0 : static_cast<int>(wait.count()));
  if (ready > 0) {
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const short events = files[i + 2].revents;
      Client& client = clients_.at(ids[i]);
      if ((events & POLLOUT) != 0) flush(client);
      if ((events & (POLLIN | POLLHUP | POLLERR)) != 0) receive(client);
      if ((events & (POLLHUP | POLLERR)) != 0) client.hung_up = true;
    }
    if ((files[1].revents & POLLIN) != 0) accept_clients();
  }
  return (files[0].revents & POLLIN) != 0;
}

// Round robin, a line of each client at a time: one that floods delays the others by no more than
// its share.
void LineServer::serve_lines() {
  std::vector<ClientId> order;
  for (const auto& [id, client] : clients_) order.push_back(id);
  std::rotate(order.begin(), std::upper_bound(order.begin(), order.end(), turn_), order.end());
  std::size_t lines = 0;
  for (bool any = true; any && lines < settings_.max_lines_per_turn;) {
    any = false;
    for (const ClientId id : order) {
      if (lines >= settings_.max_lines_per_turn) break;
      const auto client = clients_.find(id);
      if (client == clients_.end() || !take_line(id, client->second)) continue;
      turn_ = id;
      any = true;
      ++lines;
    }
  }
}

void LineServer::accept_clients() {
  // A burst of connections is accepted in parts; the rest waits in the kernel's queue.
  for (int i = 0; i < 16; ++i) {
    const int file = ::accept4(listener_.file(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (file < 0) return;
    ucred credentials{};
    socklen_t size = sizeof credentials;
    if (::getsockopt(file, SOL_SOCKET, SO_PEERCRED, &credentials, &size) != 0) {
      ::close(file);
      continue;
    }
    admit(file, {credentials.pid, credentials.uid, credentials.gid});
  }
}

void LineServer::admit(int file, const Peer& peer) {
  if (clients_.size() >= settings_.max_clients) drop_longest_idle();
  const ClientId id = next_++;
  Client& client = clients_[id];
  client.file = file;
  client.peer = peer;
  client.line_start = client.active = steady_clock::now();
  if (!is_allowed(peer)) {
    client.out = "{\"v\": 1, \"ok\": false, \"error\": \"you may not use this socket\"}\n";
    client.closing = true;
    client.reason = "user " + std::to_string(peer.uid) + " may not use the control socket";
    flush(client);
    return;
  }
  if (handlers_.joined) handlers_.joined(id, peer);
}

bool LineServer::is_allowed(const Peer& peer) const {
  return peer.uid == 0 || peer.uid == ::geteuid() ||
         is_member(peer.uid, peer.gid, listener_.group());
}

/// Idle clients cannot keep others out.
void LineServer::drop_longest_idle() {
  const auto longest_idle = std::min_element(
      clients_.begin(), clients_.end(),
      [](const auto& a, const auto& b) { return a.second.active < b.second.active; });
  if (longest_idle == clients_.end()) return;
  longest_idle->second.reason = "too many clients: it was idle for the longest time";
  longest_idle->second.closing = true;
  longest_idle->second.out.clear();
  longest_idle->second.sent = 0;
  drop_finished(steady_clock::now());
}

void LineServer::receive(Client& client) {
  if (client.closing || client.half_closed) return;
  std::array<char, 8192> part{};
  while (client.in.size() < settings_.max_line_bytes) {
    const ssize_t got = ::recv(client.file, part.data(), part.size(), 0);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (got <= 0) {
      client.half_closed = true;
      if (client.reason.empty()) client.reason = "the client disconnected";
      return;
    }
    if (client.in.empty()) client.line_start = steady_clock::now();
    client.in.append(part.data(), static_cast<std::size_t>(got));
  }
}

bool LineServer::take_line(ClientId id, Client& client) {
  if (client.closing) return false;
  const std::size_t end = client.in.find('\n');
  if (end == std::string::npos) {
    if (client.in.size() < settings_.max_line_bytes) return false;
    send(id, "{\"v\": 1, \"ok\": false, \"error\": \"the line is longer than " +
                 std::to_string(settings_.max_line_bytes) + " bytes\"}");
    client.reason = "a line was too long";
    client.closing = true;
    client.in.clear();
    return false;
  }
  std::string line = client.in.substr(0, end);
  client.in.erase(0, end + 1);
  client.line_start = client.active = steady_clock::now();
  if (!line.empty() && line.back() == '\r') line.pop_back();
  if (!line.empty() && handlers_.line) handlers_.line(id, line);
  return true;
}

void LineServer::send(ClientId id, std::string_view line) {
  const auto found = clients_.find(id);
  if (found == clients_.end() || found->second.closing) return;
  Client& client = found->second;
  if (client.out.size() - client.sent + line.size() + 1 > settings_.max_unread_bytes) {
    client.reason = "it does not read its answers";
    client.closing = true;
    client.out.clear();
    client.sent = 0;
    return;
  }
  client.out.append(line).push_back('\n');
  flush(client);
}

void LineServer::flush(Client& client) {
  while (client.sent < client.out.size()) {
    const ssize_t put = ::send(client.file, client.out.data() + client.sent,
                               client.out.size() - client.sent, MSG_NOSIGNAL);
    if (put < 0) {
      if (errno == EAGAIN || errno == EINTR) break;
      client.closing = true;
      client.reason = "the client disconnected";
      client.sent = client.out.size();
      break;
    }
    client.sent += static_cast<std::size_t>(put);
  }
  if (client.sent == client.out.size()) {
    client.out.clear();
    client.sent = 0;
  }
}

void LineServer::drop_finished(steady_clock::time_point now) {
  for (auto at = clients_.begin(); at != clients_.end();) {
    Client& client = at->second;
    const bool all_sent = client.sent >= client.out.size();
    if (!client.in.empty() && client.in.find('\n') == std::string::npos &&
        now - client.line_start > settings_.timeout) {
      client.reason = "it did not finish a line in time";
      client.closing = true;
    }
    const bool idle = now - client.active > settings_.timeout;
    const bool left =
        client.half_closed && client.in.find('\n') == std::string::npos && (client.hung_up || idle);
    const bool stuck = client.closing && idle;
    if (!((client.closing && all_sent) || left || stuck)) {
      ++at;
      continue;
    }
    ::close(client.file);
    const ClientId id = at->first;
    const std::string reason = client.reason;
    at = clients_.erase(at);
    if (handlers_.left) handlers_.left(id, reason);
  }
}

}  // namespace stickslip::daemon
