// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_t7/protocol.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>

namespace stickslip::drivers::labjack_t7 {

namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t prefix_bytes = 6;  // transaction, protocol, length
constexpr std::size_t header_bytes = 8;  // and unit, function
constexpr std::size_t samples_at = 16;
constexpr std::uint8_t unit = 1;
constexpr std::uint8_t feedback_function = 76;
constexpr std::uint8_t exception_bit = 0x80;
constexpr std::uint8_t reading = 0;
constexpr std::uint8_t writing = 1;
constexpr std::uint8_t stream_type = 16;

constexpr std::uint8_t high(unsigned value) {
  return static_cast<std::uint8_t>(value >> 8U & 0xFFU);
}
constexpr std::uint8_t low(unsigned value) { return static_cast<std::uint8_t>(value & 0xFFU); }

}  // namespace

Feedback::Feedback(std::uint16_t transaction) : size_(header_bytes), transaction_(transaction) {
  bytes_[0] = high(transaction);
  bytes_[1] = low(transaction);
  bytes_[6] = unit;
  bytes_[7] = feedback_function;
  complete();
}

bool Feedback::access(std::uint8_t kind, int address, std::uint8_t registers, std::size_t data) {
  if (size_ + 4 + data > bytes_.size()) return false;
  bytes_[size_++] = kind;
  add_word(static_cast<std::uint16_t>(address));
  bytes_[size_++] = registers;
  return true;
}

void Feedback::add_word(std::uint16_t value) {
  bytes_[size_++] = high(value);
  bytes_[size_++] = low(value);
}

void Feedback::complete() {
  const auto length = static_cast<unsigned>(size_ - prefix_bytes);
  bytes_[4] = high(length);
  bytes_[5] = low(length);
}

Feedback& Feedback::write_word(int address, std::uint16_t value) {
  if (access(writing, address, 1, 2)) add_word(value);
  complete();
  return *this;
}

Feedback& Feedback::write(int address, std::uint32_t value) {
  if (access(writing, address, 2, 4)) {
    add_word(static_cast<std::uint16_t>(value >> 16U));
    add_word(static_cast<std::uint16_t>(value & 0xFFFFU));
  }
  complete();
  return *this;
}

Feedback& Feedback::write_float(int address, float value) {
  return write(address, std::bit_cast<std::uint32_t>(value));
}

Feedback& Feedback::read(int address, std::uint8_t registers) {
  if (access(reading, address, registers, 0)) reply_bytes_ += 2U * registers;
  complete();
  return *this;
}

const char* exception_name(std::uint8_t code) {
  switch (code) {
    case 1:
      return "illegal function";
    case 2:
      return "illegal address";
    case 3:
      return "illegal value";
    case 4:
      return "device failure";
    case 6:
      return "device busy";
    default:
      return "unknown exception";
  }
}

const char* error_name(std::uint16_t code) {
  switch (code) {
    case 2605:
      return "not while the stream runs";
    case 2606:
      return "invalid configuration of the stream";
    case 2607:
      return "an address that cannot be streamed";
    case 2608:
      return "too many samples per second";
    case 2615:
      return "invalid size of the buffer";
    case 2618:
      return "too many samples per packet";
    case stream_not_running:
      return "the stream is not running";
    case 2621:
      return "settling time too long";
    case 2670:
      return "time of the watchdog too short";
    case 2671:
      return "the watchdog is enabled";
    case auto_recovery_active:
      return "buffer full";
    case auto_recovery_end:
      return "end of the recovery from a full buffer";
    case 2942:
      return "scan overlap: a scan began before the last one was complete";
    case auto_recovery_overflow:
      return "more scans were skipped than the board can count";
    case 2944:
      return "end of a burst";
    default:
      return "unknown error";
  }
}

std::string in_words(const Verdict& verdict) {
  switch (verdict.kind) {
    case Verdict::Kind::ok:
      return "no error";
    case Verdict::Kind::garbled:
      return "a reply to another request";
    case Verdict::Kind::exception:
      break;
  }
  if (verdict.error == 0) {
    return "Modbus exception " + std::to_string(verdict.code) + " (" +
           exception_name(verdict.code) + ")";
  }
  return "error " + std::to_string(verdict.error) + " (" + error_name(verdict.error) + ")";
}

std::span<std::uint8_t> MessageReader::space() {
  std::copy(bytes_.begin() + static_cast<std::ptrdiff_t>(begin_),
            bytes_.begin() + static_cast<std::ptrdiff_t>(end_), bytes_.begin());
  end_ -= begin_;
  begin_ = 0;
  return std::span(bytes_).subspan(end_);
}

MessageReader::Next MessageReader::next(Bytes& message) {
  const Bytes rest(bytes_.data() + begin_, end_ - begin_);
  if (rest.size() < prefix_bytes) return Next::incomplete;
  const std::size_t size = prefix_bytes + word_at(rest, 4);
  if (word_at(rest, 2) != 0 || size < header_bytes || size > largest_message) {
    return Next::garbled;
  }
  if (rest.size() < size) return Next::incomplete;
  message = rest.first(size);
  begin_ += size;
  return Next::message;
}

std::uint16_t transaction_of(Bytes message) { return word_at(message, 0); }

Verdict parse_reply(Bytes message, std::size_t data_bytes, Bytes& data) {
  if (message.size() < header_bytes) return {Verdict::Kind::garbled};
  if (message[7] == (feedback_function | exception_bit)) {
    if (message.size() != header_bytes + 1) return {Verdict::Kind::garbled};
    return {Verdict::Kind::exception, message[8]};
  }
  if (message[7] != feedback_function || message.size() != header_bytes + data_bytes) {
    return {Verdict::Kind::garbled};
  }
  data = message.subspan(header_bytes);
  return {};
}

std::uint16_t word_at(Bytes data, std::size_t at) {
  return static_cast<std::uint16_t>(data[at] << 8U | data[at + 1]);
}

std::uint32_t double_word_at(Bytes data, std::size_t at) {
  return static_cast<std::uint32_t>(word_at(data, at)) << 16U | word_at(data, at + 2);
}

float float_at(Bytes data, std::size_t at) {
  return std::bit_cast<float>(double_word_at(data, at));
}

std::optional<StreamPacket> parse_packet(Bytes message) {
  if (message.size() < samples_at || message.size() % 2 != 0) return std::nullopt;
  if (message[7] != feedback_function || message[8] != stream_type) return std::nullopt;
  StreamPacket packet;
  packet.transaction = word_at(message, 0);
  packet.backlog_bytes = word_at(message, 10);
  packet.status = word_at(message, 12);
  packet.information = word_at(message, 14);
  packet.samples = message.subspan(samples_at);
  return packet;
}

Feedback request_identity(std::uint16_t transaction) {
  Feedback request(transaction);
  request.read(product_id, 2).read(firmware_version, 2).read(serial_number, 2);
  return request;
}

Identity identity_of(Bytes data) {
  return {.serial = double_word_at(data, 8),
          .product = float_at(data, 0),
          .firmware = float_at(data, 4)};
}

std::string firmware_of(const Identity& identity) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4f", static_cast<double>(identity.firmware));
  return text;
}

namespace {
constexpr int constants_per_block = 8;
constexpr std::uint32_t constant_bytes = 4;
}  // namespace

Feedback request_calibration(std::uint16_t transaction, int block) {
  Feedback request(transaction);
  const auto before = static_cast<std::uint32_t>(block * constants_per_block);
  request.write(flash_pointer, calibration_address + before * constant_bytes)
      .read(flash_read, 2 * constants_per_block);
  return request;
}

/// Four constants for each gain: slopes for positive and negative voltages, center, and an offset
/// that is redundant with the center.
void add_constants(labjack::ConverterCalibration& calibration, int block, Bytes data) {
  for (std::size_t half = 0; half < 2; ++half) {
    const std::size_t gain = 2 * static_cast<std::size_t>(block) + half;
    const std::size_t at = 4 * constant_bytes * half;
    calibration.positive_slope_v[gain] = static_cast<double>(float_at(data, at));
    calibration.negative_slope_v[gain] = static_cast<double>(float_at(data, at + 4));
    calibration.center[gain] = static_cast<double>(float_at(data, at + 8));
  }
}

std::int64_t interval_ns(double rate_hz) {
  constexpr double most_steps = 65536.0;
  if (!(rate_hz > 0.0) || !std::isfinite(rate_hz)) return 0;
  for (std::int64_t step_ns = 100; step_ns <= 1'000'000; step_ns *= 10) {
    const double steps = std::round(1e9 / (rate_hz * static_cast<double>(step_ns)));
    if (steps < 1.0) return 0;
    if (steps <= most_steps) return static_cast<std::int64_t>(steps) * step_ns;
  }
  return 0;
}

}  // namespace stickslip::drivers::labjack_t7
