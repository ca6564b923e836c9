// SPDX-License-Identifier: Apache-2.0
// Encoding of Modbus requests and matching of replies (application protocol and messaging on
// TCP/IP). libmodbus transfers the bytes, but does not match replies strictly: it ignores the unit
// of a TCP reply, and accepts one from "unit 0" on a serial line.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "config/modbus_map.h"

namespace stickslip::drivers::modbus {

using Bytes = std::vector<std::uint8_t>;

struct ReadRequest {
  config::RegisterTable table = config::RegisterTable::holding_registers;
  int address = 0;  ///< on the wire: counted from 0
  int count = 0;    ///< registers, or bits
  friend bool operator==(const ReadRequest&, const ReadRequest&) = default;
};

/// Unit, function and data; without the checksum of a serial line or the header of TCP.
Bytes read_message(int unit, const ReadRequest& request);
/// Writes `words` (a coil: one, 0 or 1) from `address` on: with `single` by function 6 or 5, which
/// write one element, else by 16 or 15. The table is holding_registers or coils.
Bytes write_message(int unit, config::RegisterTable table, int address,
                    std::span<const std::uint16_t> words, bool single);

enum class Verdict {
  answer,      ///< complete reply to this request
  exception,   ///< exception of the unit
  other_unit,  ///< from another unit
  mismatch     ///< function, length or address differ from the request
};

struct Reply {
  Verdict verdict = Verdict::mismatch;
  std::uint8_t exception = 0;
  std::vector<std::uint16_t> words;  ///< of a read; one word per bit, 0 or 1
};

/// True if a reply to `one` would pass for a reply to `other`, a different request: reads of one
/// unit by one function whose replies have the same length. A reply to a write repeats its address.
bool confusable(std::span<const std::uint8_t> one, std::span<const std::uint8_t> other);

/// Classifies `reply` with respect to `request`; both begin with the unit.
Reply match_reply(std::span<const std::uint8_t> request, std::span<const std::uint8_t> reply);

/// The header of TCP before a message.
constexpr std::size_t tcp_header_size = 6;
Bytes with_tcp_header(std::uint16_t transaction, std::span<const std::uint8_t> message);

/// Transaction of a reply with its header; none for an invalid header or a wrong length.
std::optional<std::uint16_t> transaction_of(std::span<const std::uint8_t> frame);

/// Meaning of an exception code: "illegal data address"; "unknown" for others.
const char* name_of_exception(std::uint8_t code);

}  // namespace stickslip::drivers::modbus
