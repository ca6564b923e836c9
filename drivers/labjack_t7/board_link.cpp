// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_t7/board_link.h"

#include <algorithm>

#include "physics/number_text.h"

namespace stickslip::drivers::labjack_t7 {

namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr std::int64_t reply_timeout_ns = 1000 * ms;

std::string address(const std::string& host, int port) { return host + ":" + std::to_string(port); }

std::string number(const Identity& identity) {
  return "LabJack T7 #" + std::to_string(identity.serial);
}

}  // namespace

Failure BoardLink::connect() {
  reader_.clear();
  name_ = "LabJack T7 at " + address(settings_.host, settings_.port);
  const std::string why = commands_.open(settings_.host, settings_.port, unacknowledged_ms);
  if (why.empty()) return std::nullopt;
  return Problem{Outcome::lost, name_ + ": cannot connect: " + why +
                                    ". Check its power, the network cable and labjack_t7.host; "
                                    "ping " +
                                    settings_.host};
}

Failure BoardLink::connect_stream() {
  const std::string why = stream_.open(settings_.host, settings_.stream_port, unacknowledged_ms);
  if (why.empty()) return std::nullopt;
  return Problem{Outcome::lost, name_ + ": cannot connect to its stream port " +
                                    address(settings_.host, settings_.stream_port) + ": " + why +
                                    ". Does another program use its stream, or is a firewall "
                                    "between?"};
}

Failure BoardLink::identify(std::uint32_t serial_at_start) {
  std::span<const std::uint8_t> data;
  if (Failure failure = request("identify it", request_identity(next_transaction()), data)) {
    return failure;
  }
  identity_ = identity_of(data);
  const std::string where = " at " + address(settings_.host, settings_.port);
  const auto wrong = [](std::string text) {
    return Problem{Outcome::needs_attention, std::move(text)};
  };
  if (static_cast<double>(identity_.product) != product_t7) {
    return wrong("the device" + where + " is product " +
                 physics::number_text(static_cast<double>(identity_.product), 6) +
                 ", expected 7 (LabJack T7). Correct labjack_t7.host");
  }
  name_ = number(identity_) + where;
  // The register map gives versions with four digits.
  if (static_cast<double>(identity_.firmware) < oldest_firmware - 0.00005) {
    return wrong(name_ + ": firmware " + firmware_of(identity_) +
                 ", expected 1.0186 or later. Update it with the vendor's Kipling");
  }
  if (settings_.serial && *settings_.serial != identity_.serial) {
    return wrong(name_ + ": expected #" + std::to_string(*settings_.serial) +
                 " (labjack_t7.serial). Correct serial or host, or connect that board");
  }
  if (serial_at_start != 0 && serial_at_start != identity_.serial) {
    return wrong(name_ + ": the run began with #" + std::to_string(serial_at_start) +
                 ", and another board has other wires and another calibration. Connect that one "
                 "again, or restart the daemon to use another");
  }
  return std::nullopt;
}

void BoardLink::close() noexcept {
  stream_.close();
  commands_.close();
}

Failure BoardLink::request(const char* purpose, const Feedback& feedback) {
  std::span<const std::uint8_t> data;
  return request(purpose, feedback, data);
}

Failure BoardLink::request(const char* purpose, const Feedback& feedback,
                           std::span<const std::uint8_t>& data) {
  Failure failure = exchange(feedback, data);
  if (!failure && verdict_.kind == Verdict::Kind::exception) {
    const Verdict refused = verdict_;
    std::span<const std::uint8_t> code;
    failure = exchange(Feedback(next_transaction()).read(last_error, 1), code);
    const bool known = !failure && static_cast<bool>(verdict_);
    verdict_ = refused;
    if (known) verdict_.error = word_at(code, 0);
  }
  if (!failure && verdict_) return std::nullopt;
  const std::string cannot = name_ + ": cannot " + purpose + ": ";
  if (failure) return Problem{failure->outcome, cannot + failure->text};
  const bool refused = verdict_.kind == Verdict::Kind::exception;
  return Problem{refused ? Outcome::needs_attention : Outcome::temporary,
                 cannot + in_words(verdict_)};
}

/// A failure without its beginning.
Failure BoardLink::exchange(const Feedback& feedback, std::span<const std::uint8_t>& data) {
  if (!commands_.is_open()) return broken("it is not connected");
  if (commands_.send(feedback.bytes()) != TcpConnection::Sent::all) {
    return broken("the connection is broken");
  }
  const std::int64_t due_ns = clock_.now_ns() + reply_timeout_ns;
  for (;;) {
    std::span<const std::uint8_t> message;
    const MessageReader::Next next = reader_.next(message);
    if (next == MessageReader::Next::garbled) {
      return broken("its answer is no Modbus TCP. Is this the right port?");
    }
    if (next == MessageReader::Next::message) {
      if (transaction_of(message) != feedback.transaction()) continue;  // late
      verdict_ = parse_reply(message, feedback.reply_bytes(), data);
      return std::nullopt;
    }
    const std::int64_t left_ns = due_ns - clock_.now_ns();
    if (left_ns <= 0 || !commands_.wait(static_cast<int>(left_ns / ms) + 1)) {
      return Problem{Outcome::temporary, "it did not answer within 1 s"};
    }
    std::size_t received = 0;
    switch (commands_.receive(reader_.space(), received)) {
      case TcpConnection::Received::bytes:
        reader_.received(received);
        break;
      case TcpConnection::Received::nothing:
        break;
      case TcpConnection::Received::ended:
        return broken("it closed the connection");
    }
  }
}

Failure BoardLink::broken(const std::string& why) {
  commands_.close();
  return Problem{Outcome::lost, why};
}

}  // namespace stickslip::drivers::labjack_t7
