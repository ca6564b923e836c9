// SPDX-License-Identifier: Apache-2.0
#include "drivers/modbus/adu.h"

#include <algorithm>

namespace stickslip::drivers::modbus {

namespace {

using config::RegisterTable;

constexpr std::uint8_t exception_bit = 0x80;

enum Function : std::uint8_t {
  read_coils = 1,
  read_discrete_inputs = 2,
  read_holding_registers = 3,
  read_input_registers = 4,
  write_coil = 5,
  write_register = 6,
  write_coils = 15,
  write_registers = 16
};

bool holds_bits(RegisterTable table) {
  return table == RegisterTable::coils || table == RegisterTable::discrete_inputs;
}

std::uint8_t reading_function(RegisterTable table) {
  switch (table) {
    case RegisterTable::coils:
      return read_coils;
    case RegisterTable::discrete_inputs:
      return read_discrete_inputs;
    case RegisterTable::input_registers:
      return read_input_registers;
    case RegisterTable::holding_registers:
      break;
  }
  return read_holding_registers;
}

void add_word(Bytes& bytes, int word) {
  bytes.push_back(static_cast<std::uint8_t>((word >> 8) & 0xFF));
  bytes.push_back(static_cast<std::uint8_t>(word & 0xFF));
}

std::uint16_t word_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint16_t>((bytes[at] << 8) | bytes[at + 1]);
}

std::vector<std::uint16_t> bits_in(std::span<const std::uint8_t> data, std::size_t count) {
  std::vector<std::uint16_t> bits(count);
  for (std::size_t i = 0; i < count; ++i) bits[i] = (data[i / 8] >> (i % 8)) & 1U;
  return bits;
}

std::vector<std::uint16_t> words_in(std::span<const std::uint8_t> data) {
  std::vector<std::uint16_t> words(data.size() / 2);
  for (std::size_t i = 0; i < words.size(); ++i) words[i] = word_at(data, 2 * i);
  return words;
}

bool reads_bits(std::span<const std::uint8_t> request) {
  return request[1] == read_coils || request[1] == read_discrete_inputs;
}

/// Number of data bytes in the reply to a read.
std::size_t data_size(std::span<const std::uint8_t> request) {
  const std::size_t count = word_at(request, 4);
  return reads_bits(request) ? (count + 7) / 8 : 2 * count;
}

Reply reply_to_read(std::span<const std::uint8_t> request, std::span<const std::uint8_t> reply) {
  const std::size_t size = data_size(request);
  if (reply.size() != 3 + size || reply[2] != size) return {};
  const auto data = reply.subspan(3);
  return {Verdict::answer, 0,
          reads_bits(request) ? bits_in(data, word_at(request, 4)) : words_in(data)};
}

}  // namespace

Bytes read_message(int unit, const ReadRequest& request) {
  Bytes message{static_cast<std::uint8_t>(unit), reading_function(request.table)};
  add_word(message, request.address);
  add_word(message, request.count);
  return message;
}

Bytes write_message(int unit, RegisterTable table, int address,
                    std::span<const std::uint16_t> words, bool single) {
  const bool bits = holds_bits(table);
  Bytes message{static_cast<std::uint8_t>(unit)};
  if (single && words.size() == 1) {
    message.push_back(bits ? write_coil : write_register);
    add_word(message, address);
    add_word(message, bits ? (words[0] != 0 ? 0xFF00 : 0) : words[0]);
    return message;
  }
  message.push_back(bits ? write_coils : write_registers);
  add_word(message, address);
  add_word(message, static_cast<int>(words.size()));
  message.push_back(static_cast<std::uint8_t>(bits ? (words.size() + 7) / 8 : 2 * words.size()));
  if (!bits) {
    for (const std::uint16_t word : words) add_word(message, word);
    return message;
  }
  const std::size_t data = message.size();
  message.resize(data + (words.size() + 7) / 8);
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i] != 0) message[data + i / 8] |= static_cast<std::uint8_t>(1U << (i % 8));
  }
  return message;
}

bool confusable(std::span<const std::uint8_t> one, std::span<const std::uint8_t> other) {
  if (std::equal(one.begin(), one.end(), other.begin(), other.end())) return false;
  return one[0] == other[0] && one[1] == other[1] && one[1] <= read_input_registers &&
         data_size(one) == data_size(other);
}

Reply match_reply(std::span<const std::uint8_t> request, std::span<const std::uint8_t> reply) {
  if (request.size() < 6 || reply.size() < 3) return {};
  if (reply[0] != request[0]) return {Verdict::other_unit, 0, {}};
  if (reply[1] == (request[1] | exception_bit)) {
    if (reply.size() != 3) return {};
    return {Verdict::exception, reply[2], {}};
  }
  if (reply[1] != request[1]) return {};
  if (request[1] <= read_input_registers) return reply_to_read(request, reply);
  // The reply to a write repeats its first six bytes: address, and value or count.
  const bool echoes = reply.size() == 6 && std::equal(reply.begin(), reply.end(), request.begin());
  return {echoes ? Verdict::answer : Verdict::mismatch, 0, {}};
}

Bytes with_tcp_header(std::uint16_t transaction, std::span<const std::uint8_t> message) {
  Bytes frame;
  frame.reserve(tcp_header_size + message.size());
  add_word(frame, transaction);
  add_word(frame, 0);  // the protocol: Modbus
  add_word(frame, static_cast<int>(message.size()));
  frame.insert(frame.end(), message.begin(), message.end());
  return frame;
}

std::optional<std::uint16_t> transaction_of(std::span<const std::uint8_t> frame) {
  if (frame.size() < tcp_header_size || word_at(frame, 2) != 0) return std::nullopt;
  if (word_at(frame, 4) + tcp_header_size != frame.size()) return std::nullopt;
  return word_at(frame, 0);
}

const char* name_of_exception(std::uint8_t code) {
  switch (code) {
    case 1:
      return "illegal function";
    case 2:
      return "illegal data address";
    case 3:
      return "illegal data value";
    case 4:
      return "device failure";
    case 5:
      return "acknowledge, processing";
    case 6:
      return "device busy";
    case 8:
      return "memory parity error";
    case 10:
      return "gateway path unavailable";
    case 11:
      return "gateway target device does not respond";
    default:
      return "unknown";
  }
}

}  // namespace stickslip::drivers::modbus
