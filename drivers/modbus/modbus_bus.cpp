// SPDX-License-Identifier: Apache-2.0
#include "drivers/modbus/modbus_bus.h"

#include <modbus/modbus.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "drivers/modbus/rs485.h"
#include "drivers/serial/serial_line.h"

namespace stickslip::drivers::modbus {

namespace {

using config::ModbusTransport;

constexpr std::int64_t second_ns = 1'000'000'000;
constexpr std::int64_t first_retry_delay_ns = second_ns / 4;
constexpr std::int64_t max_retry_delay_ns = 4 * second_ns;
constexpr std::int64_t connect_timeout_ns = second_ns;

/// Between two messages on a serial line: 3.5 characters of 11 bits, at fast rates 1.75 ms.
std::int64_t silence_between_ns(const config::ModbusUnit& unit) {
  if (unit.transport == ModbusTransport::tcp) return 0;
  const std::int64_t characters_ns = 385 * second_ns / 10 / std::max(unit.baud, 1);
  return std::max<std::int64_t>(characters_ns, 1'750'000);
}

/// Longest pause within a reply on a serial line: USB adapters pass bytes on every 16 ms.
std::int64_t pause_within_ns(const config::ModbusUnit& unit) {
  return unit.transport == ModbusTransport::tcp ? 0 : silence_between_ns(unit) + 20'000'000;
}

/// Until then `request` has to wait for late replies to others that would pass for its own.
std::int64_t quiet_until_ns(const Caller& caller, std::span<const std::uint8_t> request) {
  std::int64_t until_ns = 0;
  for (const Caller::Unanswered& other : caller.unanswered) {
    if (confusable(other.request, request)) until_ns = std::max(until_ns, other.until_ns);
  }
  return until_ns;
}

/// True for a late reply to an earlier request of the caller.
bool is_late(const Caller& caller, std::span<const std::uint8_t> reply, std::int64_t now_ns) {
  return std::any_of(caller.unanswered.begin(), caller.unanswered.end(), [&](const auto& one) {
    return now_ns < one.until_ns && match_reply(one.request, reply).verdict == Verdict::answer;
  });
}

std::uint32_t whole_seconds(std::int64_t ns) { return static_cast<std::uint32_t>(ns / second_ns); }

std::uint32_t microseconds_beside(std::int64_t ns) {
  return static_cast<std::uint32_t>(ns % second_ns / 1000);
}

/// Node and service of "host:502" or "[::1]:502".
std::pair<std::string, std::string> host_and_port(const std::string& text) {
  const auto colon = text.rfind(':');
  if (colon == std::string::npos) return {text, "502"};
  std::string host = text.substr(0, colon);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  }
  return {host, text.substr(colon + 1)};
}

/// Errors of the library for invalid replies. All others but time-outs concern the connection.
bool is_protocol_error(int error) { return error >= MODBUS_ENOBASE; }

const char* network_remedy(int error) {
  switch (error) {
    case ECONNREFUSED:
      return "the address is wrong, or the unit does not serve Modbus there, or its only "
             "connection "
             "is in use by another client";
    case ENETUNREACH:
    case EHOSTUNREACH:
      return "there is no route to it: ip route";
    default:
      return "is it on, and is the address correct? Try ping";
  }
}

}  // namespace

struct ModbusBus::Connection {
  explicit Connection(modbus_t* from) : context(from) {}
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  ~Connection() {
    // Otherwise the port stays exclusive while another process has it open.
    ::ioctl(file(), TIOCNXCL);
    modbus_close(context);
    modbus_free(context);
  }
  int file() const { return modbus_get_socket(context); }
  modbus_t* context;
};

ModbusBus::ModbusBus(const config::ModbusUnit& unit, HostClock& clock)
    : settings_(unit), clock_(clock) {}

ModbusBus::~ModbusBus() = default;

bool ModbusBus::acquire(const Caller& caller, std::int64_t until_ns) {
  std::unique_lock lock(mutex_);
  if (std::find(queue_.begin(), queue_.end(), &caller) == queue_.end()) queue_.push_back(&caller);
  const auto timeout =
      std::chrono::nanoseconds(std::max<std::int64_t>(until_ns - clock_.now_ns(), 0));
  return moved_.wait_for(lock, timeout, [&] { return queue_.front() == &caller; });
}

void ModbusBus::release(const Caller& caller) noexcept {
  {
    const std::lock_guard lock(mutex_);
    std::erase(queue_, &caller);
  }
  moved_.notify_all();
}

void ModbusBus::leave(const Caller& caller) noexcept {
  {
    const std::lock_guard lock(mutex_);
    if (!queue_.empty() && queue_.front() == &caller && pending_) {
      // The reply may still arrive. A serial line is half-duplex: no other unit is polled before
      // the reply could have arrived, and the silent interval after it.
      if (settings_.transport != ModbusTransport::tcp) last_traffic_ns_ = pending_->due_ns;
      pending_.reset();
    }
  }
  release(caller);
}

Outcome ModbusBus::connect(std::string& why) {
  const Caller self;
  // The owner releases the bus within its read wait and time-out.
  if (!acquire(self, clock_.now_ns() + 2 * second_ns)) {
    release(self);
    why = settings_.port + " is busy";
    return Outcome::lost;
  }
  const Outcome outcome = connect_locked(why);
  release(self);
  return outcome;
}

Outcome ModbusBus::connect_locked(std::string& why) {
  if (connection_) return Outcome::ok;
  if (clock_.now_ns() < next_attempt_ns_) {
    why = last_why_;
    return last_failure_;
  }
  const bool tcp = settings_.transport == ModbusTransport::tcp;
  modbus_t* context = nullptr;
  if (tcp) {
    const auto [host, port] = host_and_port(settings_.port);
    context = modbus_new_tcp_pi(host.c_str(), port.c_str());
  } else {
    context = modbus_new_rtu(settings_.port.c_str(), settings_.baud, settings_.parity, 8,
                             settings_.stop_bits);
  }
  int error = errno;
  if (context != nullptr) {
    auto connection = std::make_unique<Connection>(context);
    // Time-out of the library for connecting.
    modbus_set_response_timeout(context, whole_seconds(connect_timeout_ns), 0);
    error = modbus_connect(context) == 0 ? 0 : errno;
    if (error == 0 && !tcp) {
      // Excludes requests of other programs.
      ::ioctl(connection->file(), TIOCEXCL);
      error = prepare_direction(connection->file(), settings_, why);
      if (error != 0) return refuse_connection(error, why);
    }
    if (error == 0) {
      connection_ = std::move(connection);
      connected_ns_ = clock_.now_ns();
      last_traffic_ns_ = connected_ns_;
      retry_delay_ns_ = 0;
      return Outcome::ok;
    }
  }
  why = settings_.port + " cannot be opened (" + std::strerror(error) +
        "): " + (tcp ? network_remedy(error) : serial_port_remedy(settings_.port, error));
  return refuse_connection(error, why);
}

Outcome ModbusBus::refuse_connection(int error, const std::string& why) {
  retry_delay_ns_ = std::clamp(2 * retry_delay_ns_, first_retry_delay_ns, max_retry_delay_ns);
  next_attempt_ns_ = clock_.now_ns() + retry_delay_ns_;
  last_failure_ = open_outcome(error);
  last_why_ = why;
  return last_failure_;
}

void ModbusBus::disconnect() noexcept {
  connection_.reset();
  pending_.reset();
}

int ModbusBus::unread() const {
  int bytes = 0;
  return ::ioctl(connection_->file(), FIONREAD, &bytes) == 0 ? bytes : 0;
}

std::int64_t ModbusBus::may_send_ns(const Caller& caller) const {
  return std::max(
      connected_ns_ + caller.pause_after_connect_ns,
      last_traffic_ns_ + std::max(caller.pause_between_requests_ns, silence_between_ns(settings_)));
}

Exchange ModbusBus::exchange(Caller& caller, std::span<const std::uint8_t> request,
                             std::int64_t until_ns) {
  // Before queueing, so that others are served meanwhile.
  const std::int64_t quiet_ns = quiet_until_ns(caller, request);
  clock_.sleep_until(std::min(quiet_ns, until_ns));
  if (quiet_ns > until_ns || !acquire(caller, until_ns)) return {};
  Exchange exchange = step(caller, request, until_ns);
  if (exchange.progress != Progress::waiting || !pending_) {
    if (exchange.progress != Progress::waiting) settle(caller, request, exchange);
    pending_.reset();
    release(caller);
  }
  return exchange;
}

Exchange ModbusBus::step(Caller& caller, std::span<const std::uint8_t> request,
                         std::int64_t until_ns) {
  Exchange so_far;
  if (!connection_) return broken(std::move(so_far), ENOTCONN);
  if (!pending_) {
    if (settings_.transport != ModbusTransport::tcp && unread() > 0) {  // the line is not free yet
      ++so_far.rejected;
      if (modbus_flush(connection_->context) < 0) return broken(std::move(so_far), errno);
      last_traffic_ns_ = clock_.now_ns();
    }
    const std::int64_t may_send = may_send_ns(caller);
    clock_.sleep_until(std::min(may_send, until_ns));
    if (may_send > until_ns) return so_far;
    if (!send(caller, request, so_far)) return broken(std::move(so_far), errno);
  }
  return await(caller, request, until_ns, std::move(so_far));
}

bool ModbusBus::send(const Caller& caller, std::span<const std::uint8_t> request,
                     Exchange& so_far) {
  modbus_t* context = connection_->context;
  if (unread() > 0) ++so_far.rejected;
  if (modbus_flush(context) < 0) return false;
  if (modbus_set_slave(context, caller.unit) != 0) return false;
  Pending pending;
  pending.sent_ns = clock_.now_ns();
  pending.due_ns = pending.sent_ns + caller.timeout_ns;
  if (settings_.transport == ModbusTransport::tcp) {
    pending.transaction = ++transaction_;
    // Not by modbus_send_raw_request, which sends transaction 0 with every request.
    const Bytes frame = with_tcp_header(pending.transaction, request);
    const auto sent = ::send(connection_->file(), frame.data(), frame.size(), MSG_NOSIGNAL);
    if (sent != static_cast<ssize_t>(frame.size())) return false;
  } else if (!send_serial(request)) {
    return false;
  }
  pending_ = pending;
  return true;
}

bool ModbusBus::send_serial(std::span<const std::uint8_t> request) {
  modbus_t* context = connection_->context;
  Transmission transmission(connection_->file(), settings_, clock_);
  if (!transmission.begun()) return false;
  const int sent =
      modbus_send_raw_request(context, request.data(), static_cast<int>(request.size()));
  return sent >= 0 && transmission.finish(static_cast<std::size_t>(sent));
}

Exchange ModbusBus::await(const Caller& caller, std::span<const std::uint8_t> request,
                          std::int64_t until_ns, Exchange so_far) {
  for (;;) {
    const std::int64_t now = clock_.now_ns();
    const std::int64_t left = std::min(until_ns, pending_->due_ns) - now;
    pollfd waited{connection_->file(), POLLIN, 0};
    const std::int64_t left_ms = std::max<std::int64_t>(0, (left + 999'999) / 1'000'000);
    const int ready = ::poll(&waited, 1, static_cast<int>(left_ms));
    if (ready < 0 && errno != EINTR) return broken(std::move(so_far), errno);
    if (ready > 0) {
      if (receive(caller, request, so_far)) return so_far;
      continue;
    }
    if (clock_.now_ns() >= pending_->due_ns) {
      so_far.progress = Progress::silent;
      return so_far;
    }
    if (clock_.now_ns() >= until_ns) return so_far;
  }
}

/// True if the request is completed.
bool ModbusBus::receive(const Caller& caller, std::span<const std::uint8_t> request,
                        Exchange& so_far) {
  modbus_t* context = connection_->context;
  // On TCP the complete reply within the rest of the time-out: without a limit between bytes, the
  // library applies the time-out of the first byte to all of them. On a serial line a pause shows
  // that the rest was lost.
  const std::int64_t left = std::max<std::int64_t>(pending_->due_ns - clock_.now_ns(), 1'000'000);
  modbus_set_response_timeout(context, whole_seconds(left), microseconds_beside(left));
  modbus_set_byte_timeout(context, 0, microseconds_beside(pause_within_ns(settings_)));
  std::array<std::uint8_t, MODBUS_MAX_ADU_LENGTH> buffer{};
  const int size = modbus_receive_confirmation(context, buffer.data());
  const int error = errno;
  so_far.sent_ns = pending_->sent_ns;
  so_far.received_ns = clock_.now_ns();
  if (size > 0) {
    return evaluate(caller, request, std::span(buffer).first(static_cast<std::size_t>(size)),
                    so_far);
  }
  if (size == 0) return reject_foreign(buffer[0], so_far);
  if (error != ETIMEDOUT && !is_protocol_error(error)) {
    so_far = broken(std::move(so_far), error);
    return true;
  }
  ++so_far.rejected;
  so_far.progress = Progress::garbled;
  so_far.why = error == ETIMEDOUT ? "the reply is incomplete" : modbus_strerror(error);
  // The message boundaries of the TCP stream are lost.
  if (settings_.transport == ModbusTransport::tcp) disconnect();
  return true;
}

bool ModbusBus::evaluate(const Caller& caller, std::span<const std::uint8_t> request,
                         std::span<const std::uint8_t> frame, Exchange& so_far) {
  std::span<const std::uint8_t> message = frame;
  if (settings_.transport == ModbusTransport::tcp) {
    const auto transaction = transaction_of(frame);
    if (!transaction) {
      ++so_far.rejected;
      so_far.progress = Progress::garbled;
      so_far.why = "the length in the header of the reply is wrong";
      disconnect();
      return true;
    }
    if (*transaction != pending_->transaction) {  // late reply to an earlier request
      ++so_far.rejected;
      return false;
    }
    // There is no checksum: after a loss of bytes those of the next reply fill the gap, which the
    // surplus bytes reveal.
    if (unread() > 0) {
      ++so_far.rejected;
      so_far.progress = Progress::garbled;
      so_far.why = "surplus bytes after the reply";
      disconnect();
      return true;
    }
    message = frame.subspan(tcp_header_size);
  } else {
    message =
        frame.first(frame.size() - 2);  // without the checksum, which the library has verified
  }
  Reply reply = match_reply(request, message);
  switch (reply.verdict) {
    case Verdict::answer:
      so_far.progress = Progress::answered;
      so_far.words = std::move(reply.words);
      return true;
    case Verdict::exception:
      so_far.progress = Progress::exception;
      so_far.exception = reply.exception;
      return true;
    case Verdict::other_unit:
      return reject_foreign(message[0], so_far);
    case Verdict::mismatch:
      break;
  }
  ++so_far.rejected;
  if (is_late(caller, message, clock_.now_ns())) return false;
  so_far.progress = Progress::garbled;
  so_far.why = "the reply does not match the request";
  return true;
}

/// A reply of another unit is late if that unit owes one. Otherwise its address was disturbed, and
/// no other reply will follow. True if the request is completed.
bool ModbusBus::reject_foreign(std::uint8_t unit, Exchange& so_far) {
  ++so_far.rejected;
  if (clock_.now_ns() < late_until_ns_[unit]) return false;
  so_far.progress = Progress::garbled;
  so_far.why = "it is from unit " + std::to_string(unit);
  return true;
}

void ModbusBus::settle(Caller& caller, std::span<const std::uint8_t> request,
                       const Exchange& ended) {
  last_traffic_ns_ = clock_.now_ns();
  if (settings_.transport != ModbusTransport::tcp) {
    if (pending_) note_unanswered(caller, request, ended);
  } else if (ended.progress == Progress::garbled && !connection_) {
    // Late replies are identified by their transaction.
    std::string why;
    next_attempt_ns_ = 0;
    connect_locked(why);
  }
}

/// After a repetition the reply may have been that to either transmission: one may still arrive.
void ModbusBus::note_unanswered(Caller& caller, std::span<const std::uint8_t> request,
                                const Exchange& ended) {
  auto& all = caller.unanswered;
  std::erase_if(all, [this](const auto& one) { return one.until_ns <= clock_.now_ns(); });
  auto same = std::find_if(all.begin(), all.end(), [request](const auto& one) {
    return std::equal(one.request.begin(), one.request.end(), request.begin(), request.end());
  });
  std::int64_t lateness_ns = 0;
  if (ended.progress == Progress::silent) lateness_ns = 2 * caller.timeout_ns;
  if (ended.progress == Progress::garbled) lateness_ns = caller.timeout_ns;
  if (same == all.end()) {
    if (lateness_ns == 0) return;
    same = all.insert(all.end(), {Bytes(request.begin(), request.end()), 0, 0});
  }
  same->lateness_ns = std::max(same->lateness_ns, lateness_ns);
  same->until_ns = pending_->sent_ns + same->lateness_ns;
  std::int64_t& late = late_until_ns_[request[0]];
  late = std::max(late, same->until_ns);
}

Exchange ModbusBus::broken(Exchange so_far, int error) {
  so_far.progress = Progress::gone;
  so_far.why = settings_.port + " is disconnected (" + std::strerror(error) + ")";
  disconnect();
  return so_far;
}

}  // namespace stickslip::drivers::modbus
