// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/web_server.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <libwebsockets.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <exception>
#include <string>
#include <unordered_map>
#include <utility>

#include "physics/failure.h"
#include "tools/scope/connections.h"
#include "tools/scope/http_exchange.h"

namespace stickslip::scope {

namespace {

static_assert(Message::headroom >= LWS_PRE);

// Data in the kernel buffer of a slow reader is as stale as data queued here.
constexpr int send_buffer_bytes = 128 * 1024;
constexpr std::size_t most_heard_bytes = 2048;
constexpr std::size_t file_piece_bytes = 16 * 1024;
// Connections accepted, or messages written, per turn.
constexpr int max_at_once = 64;
constexpr lws_usec_t tick_us = 100'000;
constexpr const char* subprotocol = "stickslip-scope";

/// Address of the peer without its port; empty if already closed.
std::string peer_of(int file) {
  sockaddr_storage storage{};
  socklen_t size = sizeof storage;
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (getpeername(file, reinterpret_cast<sockaddr*>(&storage), &size) != 0) return {};
  const void* address =
      storage.ss_family == AF_INET6
          ? static_cast<const void*>(&reinterpret_cast<const sockaddr_in6&>(storage).sin6_addr)
          : static_cast<const void*>(&reinterpret_cast<const sockaddr_in&>(storage).sin_addr);
  return inet_ntop(storage.ss_family, address, text.data(), text.size()) == nullptr ? ""
                                                                                    : text.data();
}

}  // namespace

class WebServer::Loop {
 public:
  Loop(const Listener& listener, Admission admission, ServerLimits limits, Greeting greeting);
  ~Loop();

  void watch(int file, std::function<void()> readable);
  void every_tick(std::function<void()> tick) { tick_ = std::move(tick); }
  void send(const SharedMessage& message, const Wants& wants);
  void send_to(StreamId stream, const SharedMessage& message);
  void on_text(OnText take) { on_text_ = std::move(take); }
  void provide(Provide provide) { provide_ = std::move(provide); }
  void run();
  void stop() { stopping_ = true; }
  std::size_t streams() const { return connections_.streams(); }
  const ServerCounts& counts() const { return counts_; }

 private:
  static int on_event(lws* wsi, lws_callback_reasons reason, void* user, void* in,
                      std::size_t size);
  static void on_tick(lws_sorted_usec_list_t* timer);
  int handle(lws* wsi, lws_callback_reasons reason, std::string_view in);

  void accept_all();
  bool make_room(const std::string& peer);
  bool shed_oldest(const std::string* peer);
  void shed(lws* wsi);

  int answer_request(lws* wsi);
  Answer answer_to(const ReceivedRequest& request);
  int begin_answer(lws* wsi, Connection& connection, Answer answer, bool with_body);
  int go_on_answering(lws* wsi, Connection& connection);
  int confirm_upgrade(lws* wsi, std::string_view to);
  std::optional<Refusal> refuse_upgrade(lws* wsi, std::string_view to);
  void open_stream(lws* wsi);
  int write_stream(lws* wsi, Connection& connection);
  int take_data(lws* wsi, std::string_view piece);
  int refuse_data(lws* wsi);
  void check_time_limits();
  void remove_connection(lws* wsi);

  // libwebsockets keeps pointers to these.
  struct Timer {
    lws_sorted_usec_list_t list{};  // first: the callback gets its address
    Loop* loop = nullptr;
  };

  const Listener& listener_;
  Admission admission_;
  ServerLimits limits_;
  TimeLimits time_limits_;
  Greeting greeting_;
  PageFiles files_;
  FixedHeaders headers_;
  std::array<lws_protocols, 4> protocols_{};
  lws_retry_bo_t idle_{};
  Timer timer_;
  lws_context* context_ = nullptr;
  lws_vhost* vhost_ = nullptr;
  Connections connections_;
  std::unordered_map<lws*, std::function<void()>> watched_;
  std::function<void()> tick_;
  OnText on_text_;  // empty: streams are send-only
  Provide provide_;
  StreamId latest_stream_ = 0;
  ServerCounts counts_;
  bool stopping_ = false;
  std::exception_ptr failure_;
};

WebServer::Loop::Loop(const Listener& listener, Admission admission, ServerLimits limits,
                      Greeting greeting)
    : listener_(listener),
      admission_(std::move(admission)),
      limits_(limits),
      time_limits_{limits.request, limits.answer, limits.losing},
      greeting_(std::move(greeting)) {
  lws_set_log_level(0, nullptr);  // its log would contain text chosen by clients
  protocols_[0] = {"http", &Loop::on_event, 0, 0, 0, nullptr, 0};
  protocols_[1] = {subprotocol, &Loop::on_event, 0, 256, 0, nullptr, 0};
  protocols_[2] = {"files", &Loop::on_event, 0, 0, 0, nullptr, 0};

  lws_context_creation_info info{};
  info.port = CONTEXT_PORT_NO_LISTEN_SERVER;
  info.protocols = protocols_.data();
  info.headers = headers_.first();
  info.server_string = "stickslip";
  info.vhost_name = "stickslip";
  info.user = this;
  info.uid = static_cast<decltype(info.uid)>(-1);
  info.gid = static_cast<decltype(info.gid)>(-1);
  info.options = LWS_SERVER_OPTION_SKIP_SERVER_CANONICAL_NAME;
  info.max_http_header_data = static_cast<unsigned short>(limits_.header_bytes);
  const std::size_t connections = limits_.streams + limits_.requests;
  info.max_http_header_pool = static_cast<unsigned short>(connections + max_at_once);
  // The default is a table of the size of the limit of open files.
  info.fd_limit_per_thread = static_cast<unsigned>(connections + max_at_once + 16);
  info.timeout_secs = static_cast<unsigned>(
      std::chrono::duration_cast<std::chrono::seconds>(limits_.request).count() + 1);
  info.timeout_secs_ah_idle = info.timeout_secs;
  info.keepalive_timeout = 5;
  // Pings find clients that vanished without closing.
  idle_.secs_since_valid_ping = 20;
  idle_.secs_since_valid_hangup = 40;
  info.retry_and_idle_policy = &idle_;
  context_ = lws_create_context(&info);
  if (context_ == nullptr) throw Failure("libwebsockets cannot start");
  vhost_ = lws_get_vhost_by_name(context_, "stickslip");
  watch(listener_.file(), [this] { accept_all(); });
  timer_.loop = this;
  lws_sul_schedule(context_, 0, &timer_.list, &Loop::on_tick, tick_us);
}

WebServer::Loop::~Loop() {
  lws_sul_cancel(&timer_.list);
  lws_context_destroy(context_);
}

void WebServer::Loop::watch(int file, std::function<void()> readable) {
  lws_sock_file_fd_type descriptor{};
  // libwebsockets closes adopted files.
  descriptor.filefd = fcntl(file, F_DUPFD_CLOEXEC, 0);
  lws* wsi = descriptor.filefd < 0 ? nullptr
                                   : lws_adopt_descriptor_vhost(vhost_, LWS_ADOPT_RAW_FILE_DESC,
                                                                descriptor, "files", nullptr);
  if (wsi == nullptr) throw Failure("libwebsockets cannot watch a file");
  watched_[wsi] = std::move(readable);
}

void WebServer::Loop::run() {
  while (!stopping_ && !failure_) {
    if (lws_service(context_, 0) < 0 && !stopping_) {
      throw Failure("libwebsockets failed");
    }
  }
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
}

int WebServer::Loop::on_event(lws* wsi, lws_callback_reasons reason, void*, void* in,
                              std::size_t size) {
  lws_context* context = wsi == nullptr ? nullptr : lws_get_context(wsi);
  Loop* loop = context == nullptr ? nullptr : static_cast<Loop*>(lws_context_user(context));
  if (loop == nullptr) return 0;
  try {
    const auto* const text = static_cast<const char*>(in);
    if (text == nullptr) return loop->handle(wsi, reason, "");
    switch (reason) {
      case LWS_CALLBACK_RECEIVE:
        return loop->handle(wsi, reason, {text, size});
      case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE:
        return loop->handle(wsi, reason, text);
      default:
        return loop->handle(wsi, reason, "");
    }
  } catch (...) {  // C code called this
    if (!loop->failure_) loop->failure_ = std::current_exception();
    return -1;
  }
}

void WebServer::Loop::on_tick(lws_sorted_usec_list_t* list) {
  Loop& loop = *reinterpret_cast<Timer*>(list)->loop;
  try {
    loop.check_time_limits();
  } catch (...) {
    if (!loop.failure_) loop.failure_ = std::current_exception();
  }
  lws_sul_schedule(loop.context_, 0, list, &Loop::on_tick, tick_us);
}

int WebServer::Loop::handle(lws* wsi, lws_callback_reasons reason, std::string_view in) {
  switch (reason) {
    case LWS_CALLBACK_RAW_RX_FILE: {
      const auto found = watched_.find(wsi);
      if (found != watched_.end()) found->second();
      return 0;
    }
    case LWS_CALLBACK_HTTP:
      return answer_request(wsi);
    case LWS_CALLBACK_HTTP_BODY:  // request bodies are rejected
      return -1;
    case LWS_CALLBACK_HTTP_WRITEABLE: {
      Connection* connection = connections_.find(wsi);
      return connection == nullptr ? -1 : go_on_answering(wsi, *connection);
    }
    case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE:
      return confirm_upgrade(wsi, in);
    case LWS_CALLBACK_ESTABLISHED:
      open_stream(wsi);
      return 0;
    case LWS_CALLBACK_SERVER_WRITEABLE: {
      Connection* connection = connections_.find(wsi);
      return connection == nullptr ? -1 : write_stream(wsi, *connection);
    }
    case LWS_CALLBACK_RECEIVE:
      return take_data(wsi, in);
    case LWS_CALLBACK_WSI_DESTROY:
      remove_connection(wsi);
      return 0;
    default:
      return 0;
  }
}

void WebServer::Loop::remove_connection(lws* wsi) {
  watched_.erase(wsi);
  const Connection* connection = connections_.find(wsi);
  if (connection == nullptr) return;
  counts_.messages_lost += connection->backlog.lost();
  connections_.erase(wsi);
}

// Admission ------------------------------------------------------------------------------------

void WebServer::Loop::accept_all() {
  for (int i = 0; i < max_at_once; ++i) {
    const int file = accept4(listener_.file(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (file < 0) {
      // Without a free file descriptor an old connection has to be closed first.
      if (errno == EMFILE || errno == ENFILE) shed_oldest(nullptr);
      return;
    }
    const std::string peer = peer_of(file);
    if (!make_room(peer)) {
      ++counts_.connections_shed;
      close(file);
      continue;
    }
    const int yes = 1;
    setsockopt(file, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    setsockopt(file, SOL_SOCKET, SO_SNDBUF, &send_buffer_bytes, sizeof send_buffer_bytes);
    lws* wsi = lws_adopt_socket_vhost(vhost_, file);  // closes the file on failure
    if (wsi != nullptr) {
      connections_.add(wsi, Connection(peer, limits_.backlog_bytes, Clock::now()));
    }
  }
}

// The oldest connection without a request is closed first: browsers send their request within
// milliseconds, so a flood of idle connections does not lock users out.
bool WebServer::Loop::make_room(const std::string& peer) {
  if (connections_.requests(&peer) >= limits_.requests_per_address && !shed_oldest(&peer)) {
    return false;
  }
  return connections_.requests() < limits_.requests || shed_oldest(nullptr);
}

bool WebServer::Loop::shed_oldest(const std::string* peer) {
  lws* const oldest = connections_.oldest_request(peer);
  if (oldest != nullptr) shed(oldest);
  return oldest != nullptr;
}

void WebServer::Loop::shed(lws* wsi) {
  ++counts_.connections_shed;
  remove_connection(wsi);
  lws_set_timeout(wsi, PENDING_TIMEOUT_USER_OK, LWS_TO_KILL_ASYNC);
}

// The page -------------------------------------------------------------------------------------

int WebServer::Loop::answer_request(lws* wsi) {
  Connection* connection = connections_.find(wsi);
  if (connection == nullptr) return -1;
  const ReceivedRequest request(wsi);
  return begin_answer(wsi, *connection, answer_to(request), request.method != "HEAD");
}

Answer WebServer::Loop::answer_to(const ReceivedRequest& request) {
  const auto refusal = refuse_page(request.view(), admission_);
  Answer answer;
  if (refusal) {
    answer = answer_for(*refusal);
  } else if (auto content = provide_ ? provide_(request.path) : std::nullopt) {
    answer.content_type = content->content_type;
    answer.body = std::move(content->body);
  } else {
    answer = files_.answer_to(request);
  }
  if (answer.status >= 400) ++counts_.refused;
  return answer;
}

int WebServer::Loop::begin_answer(lws* wsi, Connection& connection, Answer answer, bool with_body) {
  if (!write_head(wsi, answer)) return -1;
  connection.enter(Stage::answering, Clock::now());
  connection.body = with_body ? std::move(answer.body) : std::string();
  connection.sent = 0;
  lws_callback_on_writable(wsi);
  return 0;
}

int WebServer::Loop::go_on_answering(lws* wsi, Connection& connection) {
  if (connection.stage != Stage::answering) return 0;
  const std::size_t left = connection.body.size() - connection.sent;
  if (left > 0) {
    std::vector<unsigned char> piece(LWS_PRE);
    const std::size_t size = std::min(left, file_piece_bytes);
    const auto* from =
        reinterpret_cast<const unsigned char*>(connection.body.data()) + connection.sent;
    piece.insert(piece.end(), from, from + size);
    const lws_write_protocol kind = size == left ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP;
    if (lws_write(wsi, piece.data() + LWS_PRE, size, kind) < 0) return -1;
    connection.sent += size;
    if (size < left) {
      lws_callback_on_writable(wsi);
      return 0;
    }
  }
  connection.body.clear();
  connection.enter(Stage::requesting, Clock::now());
  return lws_http_transaction_completed(wsi) != 0 ? -1 : 0;
}

// The stream -----------------------------------------------------------------------------------

std::optional<Refusal> WebServer::Loop::refuse_upgrade(lws* wsi, std::string_view to) {
  const Connection* connection = connections_.find(wsi);
  if (connection == nullptr || to != "websocket") {
    return Refusal{400, "a WebSocket is required"};
  }
  const ReceivedRequest request(wsi);
  if (auto refusal = refuse_stream(request.view(), admission_)) return refusal;
  if (request.subprotocol != subprotocol) {
    return Refusal{400, "the stream's subprotocol is stickslip-scope"};
  }
  if (connections_.streams() >= limits_.streams ||
      connections_.streams(&connection->peer) >= limits_.streams_per_address) {
    return Refusal{503, "the server has reached its limit of open pages"};
  }
  return std::nullopt;
}

int WebServer::Loop::confirm_upgrade(lws* wsi, std::string_view to) {
  const auto refusal = refuse_upgrade(wsi, to);
  if (!refusal) return 0;
  ++counts_.refused;
  lws_return_http_status(wsi, static_cast<unsigned>(refusal->status), refusal->reason.c_str());
  return 1;
}

void WebServer::Loop::open_stream(lws* wsi) {
  Connection* connection = connections_.find(wsi);
  if (connection == nullptr) return;
  connection->enter(Stage::streaming, Clock::now());
  ++counts_.streams_opened;
  connection->stream = ++latest_stream_;
  connection->wanted = ReceivedRequest(wsi).source;
  connection->backlog.greet(greeting_(connection->wanted));
  lws_callback_on_writable(wsi);
}

void WebServer::Loop::send(const SharedMessage& message, const Wants& wants) {
  const auto now = Clock::now();
  std::vector<lws*> past_help;
  for (auto& [wsi, connection] : connections_) {
    if (connection.stage != Stage::streaming || !wants(connection.wanted)) continue;
    if (connection.backlog.add(message, now)) {
      lws_callback_on_writable(wsi);
    } else {
      past_help.push_back(wsi);
    }
  }
  for (lws* wsi : past_help) {
    ++counts_.too_slow;
    shed(wsi);
  }
}

void WebServer::Loop::send_to(StreamId stream, const SharedMessage& message) {
  for (auto& [wsi, connection] : connections_) {
    if (connection.stage != Stage::streaming || connection.stream != stream) continue;
    if (!connection.backlog.add(message, Clock::now())) return shed(wsi);
    lws_callback_on_writable(wsi);
    return;
  }
}

int WebServer::Loop::write_stream(lws* wsi, Connection& connection) {
  for (int i = 0; i < max_at_once; ++i) {
    if (lws_send_pipe_choked(wsi) != 0) break;
    const SharedMessage message = connection.backlog.take();
    if (!message) return 0;
    const auto payload = message->payload();
    if (lws_write(wsi, payload.data(), payload.size(),
                  message->binary() ? LWS_WRITE_BINARY : LWS_WRITE_TEXT) < 0) {
      return -1;
    }
  }
  if (!connection.backlog.empty()) lws_callback_on_writable(wsi);
  return 0;
}

// In pieces, as they arrive.
int WebServer::Loop::take_data(lws* wsi, std::string_view piece) {
  Connection* const connection = connections_.find(wsi);
  if (connection == nullptr || !on_text_ || lws_frame_is_binary(wsi) != 0 ||
      connection->heard.size() + piece.size() > most_heard_bytes) {
    return refuse_data(wsi);
  }
  connection->heard += piece;
  if (lws_remaining_packet_payload(wsi) > 0 || lws_is_final_fragment(wsi) == 0) return 0;
  const std::string text = std::exchange(connection->heard, {});
  return on_text_(connection->stream, connection->wanted, text) ? 0 : refuse_data(wsi);
}

int WebServer::Loop::refuse_data(lws* wsi) {
  ++counts_.talkative;
  std::string reason = on_text_ ? "not a note" : "this stream only sends";
  lws_close_reason(wsi, LWS_CLOSE_STATUS_POLICY_VIOLATION,
                   reinterpret_cast<unsigned char*>(reason.data()), reason.size());
  return -1;
}

void WebServer::Loop::check_time_limits() {
  const auto now = Clock::now();
  for (lws* wsi : connections_.overdue(time_limits_, now)) {
    const Connection* connection = connections_.find(wsi);
    if (connection->stage == Stage::streaming) ++counts_.too_slow;
    shed(wsi);
  }
  if (tick_) tick_();
}

WebServer::WebServer(const Listener& listener, Admission admission, ServerLimits limits,
                     Greeting greeting)
    : loop_(std::make_unique<Loop>(listener, std::move(admission), limits, std::move(greeting))) {}
WebServer::~WebServer() = default;
void WebServer::watch(int file, std::function<void()> readable) {
  loop_->watch(file, std::move(readable));
}
void WebServer::every_tick(std::function<void()> tick) { loop_->every_tick(std::move(tick)); }
void WebServer::send(const SharedMessage& message, const Wants& wants) {
  loop_->send(message, wants);
}
void WebServer::send_to(StreamId stream, const SharedMessage& message) {
  loop_->send_to(stream, message);
}
void WebServer::on_text(OnText take) { loop_->on_text(std::move(take)); }
void WebServer::provide(Provide provide) { loop_->provide(std::move(provide)); }
void WebServer::run() { loop_->run(); }
void WebServer::stop() { loop_->stop(); }
std::size_t WebServer::streams() const { return loop_->streams(); }
const ServerCounts& WebServer::counts() const { return loop_->counts(); }

}  // namespace stickslip::scope
