// SPDX-License-Identifier: Apache-2.0
// Encoding of requests to a LabJack T7 and decoding of its replies: pure functions, without
// network.
//
// Sources, by LabJack: the register map (ljm_constants.json), the T-series datasheet
// (sections 3.2.4 stream, 14.3.0 inputs, 20.0.1 calibration, 23.0 watchdog), "Protocol Details
// [Direct Modbus TCP]" (function 76), and the stream example in C for Modbus TCP
// (t7_modbus_tcp_stream_example, stream, calibration). The repository NSchrading/async_labjack
// agrees with them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "drivers/labjack/converter.h"

namespace stickslip::drivers::labjack_t7 {

/// Limit of every message on Ethernet.
inline constexpr std::size_t largest_message = 1040;
inline constexpr int largest_samples_per_packet = 512;
inline constexpr int digital_lines = 23;  ///< FIO0-7, EIO0-7, CIO0-3, MIO0-2
/// Over all channels [samples/s].
inline constexpr double highest_sample_rate_hz = 100000.0;
inline constexpr double product_t7 = 7.0;
/// The first with all registers used here.
inline constexpr double oldest_firmware = 1.0186;

/// Registers by address; all but the two of 16 bits hold 32.
enum Register : std::uint16_t {
  ain0 = 0,
  dac0 = 1000,
  dio0 = 2000,  ///< 16 bits; a write makes the line an output, a read an input
  dio_state = 2800,
  stream_scan_rate = 4002,
  stream_inputs = 4004,
  stream_samples_per_packet = 4006,
  stream_settling_us = 4008,
  stream_resolution_index = 4010,
  stream_buffer_bytes = 4012,
  stream_clock_source = 4014,
  stream_target = 4016,
  stream_data_type = 4018,
  stream_scans = 4020,
  stream_trigger = 4024,
  stream_list0 = 4100,
  stream_enable = 4990,
  ain0_range = 40000,
  ain0_negative = 41000,  ///< 16 bits, one address per input
  last_error = 55000,     ///< 16 bits
  product_id = 60000,
  firmware_version = 60004,
  serial_number = 60028,
  watchdog_enable = 61600,
  watchdog_advanced = 61602,
  watchdog_timeout_s = 61604,
  watchdog_startup_delay_s = 61606,
  watchdog_strict = 61610,
  watchdog_strict_key = 61612,
  watchdog_strict_clear = 61614,
  watchdog_reset = 61620,
  watchdog_dio = 61630,
  watchdog_dio_state = 61632,
  watchdog_dio_direction = 61634,
  watchdog_dio_inhibit = 61636,
  watchdog_dac0 = 61640,
  watchdog_dac0_v = 61642,
  watchdog_dac1 = 61650,
  watchdog_dac1_v = 61652,
  flash_pointer = 61810,
  flash_read = 61812,
};

inline constexpr std::uint16_t single_ended = 199;
inline constexpr std::uint32_t ethernet_target = 1;
inline constexpr std::uint32_t calibration_address = 0x3C4000;
/// Only writes of this key restart the watchdog: no other traffic keeps the amplifier on.
inline constexpr std::uint32_t watchdog_key = 0x5354534C;

/// Error codes of the board that the driver distinguishes.
enum ErrorCode : std::uint16_t {
  stream_not_running = 2620,
  auto_recovery_active = 2940,
  auto_recovery_end = 2941,
  auto_recovery_overflow = 2943,
};

/// Several accesses in one request (function 76), executed in order. Accesses that exceed the
/// request are dropped; those that this driver combines fit.
class Feedback {
 public:
  explicit Feedback(std::uint16_t transaction);
  Feedback& write_word(int address, std::uint16_t value);
  Feedback& write(int address, std::uint32_t value);
  Feedback& write_float(int address, float value);
  /// `registers`: of 16 bits each. The reply holds the values in the order of the reads.
  Feedback& read(int address, std::uint8_t registers);

  std::uint16_t transaction() const { return transaction_; }
  std::span<const std::uint8_t> bytes() const { return {bytes_.data(), size_}; }
  /// Bytes of data in the reply.
  std::size_t reply_bytes() const { return reply_bytes_; }

 private:
  bool access(std::uint8_t kind, int address, std::uint8_t registers, std::size_t data);
  void add_word(std::uint16_t value);
  void complete();

  std::array<std::uint8_t, largest_message> bytes_{};
  std::size_t size_ = 0;
  std::size_t reply_bytes_ = 0;
  std::uint16_t transaction_;
};

/// Result of checking a reply.
struct Verdict {
  enum class Kind : std::uint8_t {
    ok,
    garbled,    ///< not a reply to this request
    exception,  ///< of Modbus: `code` is the exception, `error` the board's own code, 0: unknown
  };
  Kind kind = Kind::ok;
  std::uint8_t code = 0;
  std::uint16_t error = 0;

  explicit operator bool() const { return kind == Kind::ok; }
};
/// In one word, and back.
constexpr std::uint32_t packed(const Verdict& verdict) {
  return static_cast<std::uint32_t>(verdict.kind) | static_cast<std::uint32_t>(verdict.code) << 8U |
         static_cast<std::uint32_t>(verdict.error) << 16U;
}
constexpr Verdict unpacked(std::uint32_t word) {
  return {static_cast<Verdict::Kind>(word & 0xFFU), static_cast<std::uint8_t>(word >> 8U & 0xFFU),
          static_cast<std::uint16_t>(word >> 16U)};
}

/// Name of an error code of the board, or of a Modbus exception; "unknown error" for others.
const char* error_name(std::uint16_t code);
const char* exception_name(std::uint8_t code);
/// For messages, without the name of the board: "error 2608 (...)".
std::string in_words(const Verdict& verdict);

/// Messages in the bytes of a connection.
class MessageReader {
 public:
  enum class Next : std::uint8_t { message, incomplete, garbled };

  /// Where to receive; not empty after `next` was `incomplete`.
  std::span<std::uint8_t> space();
  void received(std::size_t bytes) { end_ += bytes; }
  /// The next complete message; valid until space(). After `garbled` nothing can be found any more.
  Next next(std::span<const std::uint8_t>& message);
  /// Forgets everything.
  void clear() { begin_ = end_ = 0; }

 private:
  std::array<std::uint8_t, 4 * largest_message> bytes_{};
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
};

/// Of a message that MessageReader found.
std::uint16_t transaction_of(std::span<const std::uint8_t> message);
/// The reply to a Feedback with that many bytes of data.
Verdict parse_reply(std::span<const std::uint8_t> message, std::size_t data_bytes,
                    std::span<const std::uint8_t>& data);

/// Values in the data of a reply.
std::uint16_t word_at(std::span<const std::uint8_t> data, std::size_t at);
std::uint32_t double_word_at(std::span<const std::uint8_t> data, std::size_t at);
float float_at(std::span<const std::uint8_t> data, std::size_t at);

/// One packet of the stream.
struct StreamPacket {
  std::uint16_t transaction = 0;
  std::uint16_t backlog_bytes = 0;        ///< left in the board's buffer
  std::uint16_t status = 0;               ///< 0, or an ErrorCode
  std::uint16_t information = 0;          ///< with auto_recovery_end: the number of skipped scans
  std::span<const std::uint8_t> samples;  ///< 16 bits each, the high byte first
};
/// None: not a packet of the stream.
std::optional<StreamPacket> parse_packet(std::span<const std::uint8_t> message);

struct Identity {
  std::uint32_t serial = 0;
  float product = 0.0F;
  float firmware = 0.0F;
};
Feedback request_identity(std::uint16_t transaction);
/// `data`: of the reply to request_identity.
Identity identity_of(std::span<const std::uint8_t> data);
/// "1.0297"
std::string firmware_of(const Identity& identity);

/// The constants of the inputs of a stream: 16 numbers, in blocks of 8. The others belong to the
/// converter of the Pro, which does not stream, and to parts that the board corrects by itself.
inline constexpr int calibration_blocks = 2;
Feedback request_calibration(std::uint16_t transaction, int block);
/// `data`: of the reply to block `block`.
void add_constants(labjack::ConverterCalibration& calibration, int block,
                   std::span<const std::uint8_t> data);

/// The interval between scans that the board makes of a rate: it counts in steps of 100 ns, or for
/// rates below 152.6 Hz of 1 us, and so on by factors of ten [ns]. 0: the rate is out of range.
std::int64_t interval_ns(double rate_hz);

}  // namespace stickslip::drivers::labjack_t7
