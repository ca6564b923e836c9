// Requests and replies as they travel (the Modbus application protocol, and its messaging on
// TCP/IP). The library moves the bytes; whether a reply is the one that was asked for is decided
// here: of a TCP reply the library does not look at the unit that it comes from, and on a serial
// line it takes one from "unit 0".
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
  int address = 0;  ///< as it travels: counted from 0
  int count = 0;    ///< registers, or bits
  friend bool operator==(const ReadRequest&, const ReadRequest&) = default;
};

/// Unit, function and data; without the checksum of a serial line or the header of TCP.
Bytes read_message(int unit, const ReadRequest& request);
/// Writes `words` (a coil: one, 0 or 1) from `address` on: with `single` by function 6 or 5, which
/// carry one, else by 16 or 15. The table is holding_registers or coils.
Bytes write_message(int unit, config::RegisterTable table, int address,
                    std::span<const std::uint16_t> words, bool single);

enum class Verdict {
  answer,       ///< to this request, whole
  exception,    ///< the unit refuses
  other_unit,   ///< from another unit
  not_believed  ///< of another function, length or address than the request's
};

struct Reply {
  Verdict verdict = Verdict::not_believed;
  std::uint8_t exception = 0;
  std::vector<std::uint16_t> words;  ///< of a read; of bits one word each, 0 or 1
};

/// What `reply` is to `request`; both from the unit on.
Reply reply_to(std::span<const std::uint8_t> request, std::span<const std::uint8_t> reply);

/// The header of TCP before a message.
constexpr std::size_t tcp_header_size = 6;
Bytes with_tcp_header(std::uint16_t transaction, std::span<const std::uint8_t> message);

/// Of a reply with its header; nothing where the header is none, or tells of another length.
std::optional<std::uint16_t> transaction_of(std::span<const std::uint8_t> frame);

/// What an exception code means: "illegal data address"; of unknown ones "unknown".
const char* name_of_exception(std::uint8_t code);

}  // namespace stickslip::drivers::modbus
