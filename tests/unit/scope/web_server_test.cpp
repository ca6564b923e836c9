// SPDX-License-Identifier: Apache-2.0
// The limits of the server, with small values. tests/end_to_end/scope_server.py tests browsers and
// hostile clients with the real ones.
#include "tools/scope/web_server.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "tools/scope/wire.h"

namespace stickslip::scope {
namespace {

using namespace std::chrono_literals;
constexpr int timeout_ms = 5000;

/// A TCP client with received data as text.
class Client {
 public:
  explicit Client(std::uint16_t port, int receive_buffer = 0) {
    file_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (receive_buffer > 0) {
      setsockopt(file_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
    }
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(port);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(connect(file_, reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
  }
  ~Client() { close(file_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  void send(const std::string& text) {
    EXPECT_EQ(::send(file_, text.data(), text.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(text.size()));
  }
  void open_stream() {
    send(
        "GET /stream HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Protocol: stickslip-scope\r\n\r\n");
  }
  /// Reads until `what` has been received; false if the connection ends before.
  bool wait_for(const std::string& what) {
    while (got_.find(what) == std::string::npos) {
      if (!more()) return false;
    }
    return true;
  }
  /// True if the server closes the connection; data until then is discarded.
  bool ends() {
    while (more()) got_.clear();
    return !timed_out_;
  }

 private:
  bool more() {
    pollfd readable{file_, POLLIN, 0};
    if (poll(&readable, 1, timeout_ms) <= 0) {
      timed_out_ = true;
      return false;
    }
    std::string piece(65536, '\0');
    const ssize_t size = recv(file_, piece.data(), piece.size(), 0);
    if (size <= 0) return false;
    got_.append(piece, 0, static_cast<std::size_t>(size));
    return true;
  }

  int file_ = -1;
  std::string got_;
  bool timed_out_ = false;
};

/// A server in a thread; posted functions run in that thread.
class ServerTest : public testing::Test {
 protected:
  void start(ServerLimits limits) {
    server = std::make_unique<WebServer>(listener, Admission{}, limits, [](std::string_view) {
      return std::vector<SharedMessage>{shared_message("{\"type\":\"hello\"}", Keep::always)};
    });
    server->watch(wake, [this] {
      std::uint64_t count = 0;
      ASSERT_EQ(read(wake, &count, sizeof count), static_cast<ssize_t>(sizeof count));
      if (work) work();
    });
    server->every_tick([this] {
      if (each_tick) each_tick();
    });
    thread = std::thread([this] {
      try {
        server->run();
      } catch (const std::exception& error) {
        failure = error.what();
      }
      ended = true;
    });
  }
  void post(std::function<void()> what) {
    work = std::move(what);
    const std::uint64_t one = 1;
    ASSERT_EQ(write(wake, &one, sizeof one), static_cast<ssize_t>(sizeof one));
  }
  void TearDown() override {
    if (!thread.joinable()) return;
    if (!ended) post([this] { server->stop(); });
    thread.join();
    close(wake);
  }

  /// Waits for `condition`; false after 20 s.
  static bool holds(const std::function<bool()>& condition) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(timeout_ms);
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      std::this_thread::sleep_for(5ms);
    }
    return true;
  }

  std::atomic<std::size_t> streams = 0;
  std::atomic<std::uint64_t> too_slow = 0;
  std::atomic<int> sent = 0;
  Listener listener{{"127.0.0.1", 0}};
  std::uint16_t port = listener.address().port;
  int wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  std::function<void()> work;
  std::function<void()> each_tick;
  std::unique_ptr<WebServer> server;
  std::string failure;
  std::atomic<bool> ended = false;
  std::thread thread;
};

TEST_F(ServerTest, ClosesAStreamThatKeepsLosing) {
  ServerLimits limits;
  limits.losing = 300ms;
  limits.backlog_bytes = 100'000;
  each_tick = [this] {  // in a second more than the kernel buffers
    server->send(shared_message(std::size_t{90'000}));
    streams = server->streams();
    too_slow = server->counts().too_slow;
  };
  start(limits);
  Client slow(port, 2048);
  slow.open_stream();
  ASSERT_TRUE(slow.wait_for("hello"));
  EXPECT_TRUE(holds([this] { return too_slow == 1 && streams == 0; }));
  EXPECT_TRUE(slow.ends());
}

TEST_F(ServerTest, KeepsAStreamThatReads) {
  ServerLimits limits;
  limits.losing = 1ms;
  each_tick = [this] {
    server->send(shared_message(std::size_t{1000}));
    ++sent;
    too_slow = server->counts().too_slow;
  };
  start(limits);
  Client good(port);
  good.open_stream();
  ASSERT_TRUE(good.wait_for("hello"));
  EXPECT_TRUE(holds([this] { return sent > 20; }));
  EXPECT_EQ(too_slow, 0U);
}

TEST_F(ServerTest, ClosesAConnectionWithoutARequest) {
  ServerLimits limits;
  limits.request = 200ms;
  start(limits);
  Client silent(port);
  Client halfway(port);
  halfway.send("GET / HTTP/1.1\r\nHost: local");
  EXPECT_TRUE(silent.ends());
  EXPECT_TRUE(halfway.ends());
}

TEST_F(ServerTest, ClosesTheOldestIdleConnectionButNoStream) {
  ServerLimits limits;
  limits.requests = 3;
  limits.request = 1h;
  start(limits);
  Client stream(port);
  stream.open_stream();
  ASSERT_TRUE(stream.wait_for("hello"));
  Client oldest(port);
  std::vector<std::unique_ptr<Client>> others;
  for (int i = 0; i < 3; ++i) others.push_back(std::make_unique<Client>(port));
  EXPECT_TRUE(oldest.ends());
  others.back()->open_stream();
  EXPECT_TRUE(others.back()->wait_for("hello"));
}

TEST_F(ServerTest, LimitsTheNumberOfStreams) {
  ServerLimits limits;
  limits.streams_per_address = 1;
  start(limits);
  auto first = std::make_unique<Client>(port);
  first->open_stream();
  ASSERT_TRUE(first->wait_for("hello"));
  Client second(port);
  second.open_stream();
  EXPECT_TRUE(second.wait_for(" 503 "));
}

TEST_F(ServerTest, RethrowsExceptionsOfCallbacks) {
  start({});
  post([] { throw std::runtime_error("by the test"); });
  thread.join();
  EXPECT_EQ(failure, "by the test");
}

}  // namespace
}  // namespace stickslip::scope
