// SPDX-License-Identifier: Apache-2.0
#include "tools/control_client/control_client.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "physics/failure.h"
#include "physics/problem.h"
#include "protocol/control.h"

namespace stickslip::control_client {
namespace {

using nlohmann::json;
using std::chrono::steady_clock;

std::string remedy(int error) {
  switch (error) {
    case ENOENT:
      return "; is the daemon running, with a control socket there? (stickslipd --control PATH, or "
             "systemctl start stickslipd)";
    case ECONNREFUSED:
      return "; it belongs to a daemon that has ended: start it again";
    case EACCES:
      return "; this user must be in the daemon's group: usermod -aG stickslip USER, then log in "
             "again";
    default:
      return "";
  }
}

}  // namespace

ControlClient::ControlClient(const std::string& socket) : socket_(socket) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (socket.size() >= sizeof address.sun_path) {
    throw InputError(Problem{socket, 0, 0, "the path is too long for a socket"});
  }
  socket.copy(address.sun_path, socket.size());
  file_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (file_ < 0 ||
      ::connect(file_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    const int error = errno;
    if (file_ >= 0) ::close(file_);
    throw InputError(
        Problem{socket, 0, 0,
                std::string("no daemon can be reached: ") + std::strerror(error) + remedy(error)});
  }
}

ControlClient::~ControlClient() { ::close(file_); }

void ControlClient::send(const std::string& text) {
  for (std::size_t sent = 0; sent < text.size();) {
    const ssize_t put = ::send(file_, text.data() + sent, text.size() - sent, MSG_NOSIGNAL);
    if (put < 0 && errno == EINTR) continue;
    // The daemon refuses a stranger and closes: its last line is still to be read.
    if (put < 0 && (errno == EPIPE || errno == ECONNRESET)) return;
    if (put < 0) throw Failure(socket_ + ": " + std::strerror(errno));
    sent += static_cast<std::size_t>(put);
  }
}

std::optional<json> ControlClient::line(steady_clock::time_point until) {
  for (;;) {
    if (const std::size_t end = in_.find('\n'); end != std::string::npos) {
      json out = json::parse(in_.substr(0, end), nullptr, false);
      in_.erase(0, end + 1);
      if (out.is_discarded() || !out.is_object()) {
        throw Failure(socket_ + ": the answer is not from a stickslipd");
      }
      return out;
    }
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(until - steady_clock::now());
    pollfd file{file_, POLLIN, 0};
    const int ready = ::poll(&file, 1, static_cast<int>(std::max<std::int64_t>(0, left.count())));
    if (ready == 0) return std::nullopt;
    if (ready < 0) {
      if (errno == EINTR) continue;
      throw Failure(socket_ + ": " + std::strerror(errno));
    }
    std::array<char, 8192> part{};
    const ssize_t got = ::recv(file_, part.data(), part.size(), 0);
    if (got <= 0) throw Failure(socket_ + ": the daemon disconnected");
    in_.append(part.data(), static_cast<std::size_t>(got));
  }
}

json ControlClient::ask(const std::string& command, const json& arguments,
                        std::chrono::milliseconds timeout) {
  const std::int64_t id = next_id_++;
  send(protocol::control_request(id, command, arguments));
  const auto until = steady_clock::now() + timeout;
  while (auto answer = line(until)) {
    if (answer->contains("ok") && answer->value("id", id) == id) return *answer;
    kept_.push_back(*std::move(answer));
  }
  throw Failure(socket_ + ": no answer to \"" + command + "\" within " +
                std::to_string(timeout.count()) + " ms");
}

std::optional<json> ControlClient::next(std::chrono::milliseconds wait) {
  if (!kept_.empty()) {
    json out = std::move(kept_.front());
    kept_.erase(kept_.begin());
    return out;
  }
  return line(steady_clock::now() + wait);
}

std::string control_socket(const std::string& option) {
  if (!option.empty()) return option;
  const char* const named = std::getenv("STICKSLIP_CONTROL");
  return named != nullptr && *named != '\0' ? named : protocol::default_control_socket;
}

}  // namespace stickslip::control_client
