// SPDX-License-Identifier: Apache-2.0
// The client of the control socket, against a server that follows a script.
#include "tools/control_client/control_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

#include "physics/problem.h"
#include "protocol/control.h"

namespace stickslip::control_client {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::json;
using testing::HasSubstr;

sockaddr_un address_of(const fs::path& path) {
  sockaddr_un out{};
  out.sun_family = AF_UNIX;
  path.string().copy(out.sun_path, sizeof out.sun_path - 1);
  return out;
}

/// One connection, seen by the server.
class Peer {
 public:
  explicit Peer(int file) : file_(file) {}
  ~Peer() { ::close(file_); }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  json request() {
    std::string line;
    for (char c = 0; ::recv(file_, &c, 1, 0) == 1 && c != '\n';) line += c;
    return json::parse(line, nullptr, false);
  }
  void send(const std::string& text) {
    ASSERT_EQ(::send(file_, text.data(), text.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(text.size()));
  }
  void answer(const json& object) { send(object.dump() + "\n"); }

 private:
  int file_;
};

class ControlClientTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "stickslip-ctl-XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    socket_ = folder_ / "control.sock";
  }
  void TearDown() override {
    if (server_.joinable()) server_.join();
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  /// Listens, and runs `script` on the first connection in a thread.
  void serve(std::function<void(Peer&)> script) {
    const int listener = listen_at(socket_);
    server_ = std::thread([listener, script = std::move(script)] {
      Peer peer(::accept(listener, nullptr, nullptr));
      ::close(listener);
      script(peer);
    });
  }
  static int listen_at(const fs::path& path) {
    const int out = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_un address = address_of(path);
    EXPECT_EQ(::bind(out, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(::listen(out, 1), 0);
    return out;
  }
  std::string connection_error(const std::string& path) const {
    try {
      const ControlClient client(path);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  fs::path folder_;
  fs::path socket_;
  std::thread server_;
};

// A daemon refuses a stranger when the connection is made, and closes it.
TEST_F(ControlClientTest, ARefusalSentBeforeTheRequestIsReported) {
  serve([](Peer& peer) { peer.answer({{"ok", false}, {"error", "you may not use this socket"}}); });
  ControlClient client(socket_);
  server_.join();
  EXPECT_EQ(client.ask("clear")["error"], "you may not use this socket");
}

TEST_F(ControlClientTest, SendsARequestAndReturnsItsAnswer) {
  json request;
  serve([&request](Peer& peer) {
    request = peer.request();
    peer.answer({{"v", 1}, {"id", request["id"]}, {"ok", true}, {"state", "running"}});
  });
  ControlClient client(socket_);
  const json answer = client.ask("start", {{"dead_man", true}});
  server_.join();
  EXPECT_EQ(answer["state"], "running");
  EXPECT_EQ(request["v"], protocol::control_version);
  EXPECT_EQ(request["do"], "start");
  EXPECT_EQ(request["dead_man"], true);
}

TEST_F(ControlClientTest, MatchesAnswersByIdAndKeepsEvents) {
  serve([](Peer& peer) {
    const json first = peer.request();
    peer.answer({{"v", 1}, {"event", {{"code", "started"}}}});
    peer.answer({{"v", 1}, {"id", first["id"]}, {"ok", true}});
    const json second = peer.request();
    EXPECT_NE(first["id"], second["id"]);
    peer.answer({{"v", 1}, {"event", {{"code", "stopped"}}}});
    peer.answer({{"v", 1}, {"id", second["id"]}, {"ok", false}, {"error", "busy"}});
  });
  ControlClient client(socket_);
  EXPECT_EQ(client.ask("watch")["ok"], true);
  EXPECT_EQ(client.ask("reload")["error"], "busy");
  EXPECT_EQ(client.next(0ms).value()["event"]["code"], "started");
  EXPECT_EQ(client.next(0ms).value()["event"]["code"], "stopped");
  server_.join();
}

TEST_F(ControlClientTest, AssemblesLinesFromParts) {
  serve([](Peer& peer) {
    peer.request();
    for (const char* part :
         {"{\"v\":1,\"id\":1,", "\"ok\":true,\"text\":\"", "long\"}", "\n{\"ev", "ent\":1}\n"}) {
      peer.send(part);
      std::this_thread::sleep_for(1ms);
    }
  });
  ControlClient client(socket_);
  EXPECT_EQ(client.ask("status")["text"], "long");
  EXPECT_EQ(client.next(5s).value()["event"], 1);
}

TEST_F(ControlClientTest, NextReturnsNothingAfterTheTimeOut) {
  serve([](Peer& peer) { peer.request(); });
  ControlClient client(socket_);
  EXPECT_FALSE(client.next(1ms).has_value());
  EXPECT_THROW(client.ask("status", {}, 5s), std::runtime_error) << "the server has closed";
}

TEST_F(ControlClientTest, ReportsAMissingAnswer) {
  serve([](Peer& peer) {
    peer.request();
    peer.request();  // until the client closes
  });
  try {
    ControlClient client(socket_);
    client.ask("status", {}, 20ms);
    ADD_FAILURE() << "answered";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no answer to \"status\" within 20 ms"));
  }
}

TEST_F(ControlClientTest, RefusesAnotherProtocol) {
  for (const char* line : {"HTTP/1.1 400 Bad Request\n", "[1, 2]\n", "{\"v\": 1,\n"}) {
    serve([line](Peer& peer) {
      peer.request();
      peer.send(line);
    });
    {
      ControlClient client(socket_);
      EXPECT_THROW(client.ask("status"), std::runtime_error) << line;
    }
    server_.join();
    fs::remove(socket_);
  }
}

TEST_F(ControlClientTest, ReportsWhyItCannotConnect) {
  EXPECT_THAT(connection_error(folder_ / "missing.sock"), HasSubstr("stickslipd --control"));
  ::close(listen_at(socket_));
  EXPECT_THAT(connection_error(socket_), HasSubstr("start it again"));
  EXPECT_THAT(connection_error("/" + std::string(200, 'x')), HasSubstr("too long"));
}

TEST(ControlSocket, IsTheOptionTheVariableOrTheDefault) {
  unsetenv("STICKSLIP_CONTROL");
  EXPECT_EQ(control_socket(""), protocol::default_control_socket);
  setenv("STICKSLIP_CONTROL", "/tmp/other.sock", 1);
  EXPECT_EQ(control_socket(""), "/tmp/other.sock");
  EXPECT_EQ(control_socket("given.sock"), "given.sock");
  setenv("STICKSLIP_CONTROL", "", 1);
  EXPECT_EQ(control_socket(""), protocol::default_control_socket);
  unsetenv("STICKSLIP_CONTROL");
}

}  // namespace
}  // namespace stickslip::control_client
