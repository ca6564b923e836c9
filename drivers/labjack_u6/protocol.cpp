// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_u6/protocol.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <string_view>

namespace stickslip::drivers::labjack_u6 {

namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::uint8_t extended = 0xF8;
constexpr std::size_t extended_header = 6;

// Extended commands and the words that follow the header in their replies.
struct Function {
  std::uint8_t number;
  std::size_t reply_bytes;
};
constexpr Function config_u6{0x08, 38};
constexpr Function config_io{0x0B, 16};
constexpr Function stream_config{0x11, 8};
constexpr Function watchdog{0x09, 16};
constexpr Function read_cal{0x2D, 40};
constexpr std::uint8_t feedback_function = 0x00;
constexpr std::size_t feedback_data_at = 9;
constexpr std::size_t port_bytes = 3;

std::uint8_t low(std::uint16_t word) { return static_cast<std::uint8_t>(word & 0xFFU); }
std::uint8_t high(std::uint16_t word) { return static_cast<std::uint8_t>(word >> 8U); }

std::uint16_t word_at(Bytes bytes, std::size_t at) {
  return static_cast<std::uint16_t>(bytes[at] | bytes[at + 1] << 8);
}

std::uint32_t double_word_at(Bytes bytes, std::size_t at) {
  return static_cast<std::uint32_t>(word_at(bytes, at)) |
         static_cast<std::uint32_t>(word_at(bytes, at + 2)) << 16U;
}

/// Fills in length, function and both checksums. `size` is even.
void fill_header(Command& command, std::uint8_t function) {
  command.bytes[1] = extended;
  command.bytes[2] = static_cast<std::uint8_t>((command.size - extended_header) / 2);
  command.bytes[3] = function;
  const std::uint16_t sum = checksum16(command.view().subspan(extended_header));
  command.bytes[4] = low(sum);
  command.bytes[5] = high(sum);
  command.bytes[0] = checksum8(command.view().subspan(1, 5));
}

Command extended_command(std::uint8_t function, std::size_t size) {
  Command command;
  command.size = size;
  fill_header(command, function);
  return command;
}

Command two_bytes(std::uint8_t byte) {
  Command command;
  command.size = 2;
  command.bytes[0] = command.bytes[1] = byte;
  return command;
}

bool is_refusal(Bytes reply) { return reply.size() == 2 && reply[0] == 0xB8 && reply[1] == 0xB8; }

/// Framing only: a valid extended reply to `function`.
Verdict check_frame(Bytes reply, std::uint8_t function) {
  using Kind = Verdict::Kind;
  if (is_refusal(reply)) return {Kind::refused};
  if (reply.size() < extended_header + 2 || reply.size() % 2 != 0 ||
      reply.size() > largest_packet) {
    return {Kind::length};
  }
  if (reply[0] != checksum8(reply.subspan(1, 5)) ||
      word_at(reply, 4) != checksum16(reply.subspan(extended_header))) {
    return {Kind::checksum};
  }
  if (reply[1] != extended || reply[3] != function) return {Kind::command};
  if (reply[2] != (reply.size() - extended_header) / 2) return {Kind::length};
  return {};
}

Verdict check_extended(Bytes reply, const Function& function) {
  if (const Verdict frame = check_frame(reply, function.number); !frame) return frame;
  // With an error, the board need not send the rest.
  if (reply[6] != 0) return {Verdict::Kind::error, reply[6]};
  if (reply.size() != function.reply_bytes) return {Verdict::Kind::length};
  return {};
}

Verdict check_four_bytes(Bytes reply, std::uint8_t echo) {
  using Kind = Verdict::Kind;
  if (is_refusal(reply)) return {Kind::refused};
  if (reply.size() != 4) return {Kind::length};
  if (reply[0] != checksum8(reply.subspan(1))) return {Kind::checksum};
  if (reply[1] != echo) return {Kind::command};
  if (reply[2] != 0) return {Kind::error, reply[2]};
  return {};
}

/// Signed 32.32 fixed point, the fraction first.
double fixed_point(Bytes bytes) {
  const auto fraction = static_cast<double>(double_word_at(bytes, 0));
  const auto integer = static_cast<double>(static_cast<std::int32_t>(double_word_at(bytes, 4)));
  return integer + fraction / 4294967296.0;
}

struct ClockKind {
  std::uint32_t hz;
  std::uint8_t config_bits;
};
constexpr std::uint8_t clock_48_mhz = 1U << 3U;
constexpr std::uint8_t clock_divided = 1U << 1U;
// Fastest first.
constexpr ClockKind clock_kinds[] = {{48'000'000, clock_48_mhz},
                                     {4'000'000, 0},
                                     {187'500, clock_48_mhz | clock_divided},
                                     {15'625, clock_divided}};

ScanClock clock_at(const ClockKind& kind, double rate_hz) {
  const double interval = std::clamp(std::round(kind.hz / rate_hz), 1.0, 65535.0);
  return {kind.hz, static_cast<std::uint16_t>(interval), kind.config_bits};
}

struct NamedError {
  std::uint8_t code;
  const char* name;
};
constexpr NamedError named_errors[] = {
    {1, "scratch write failed"},
    {2, "scratch erase failed"},
    {3, "data buffer overflow"},
    {4, "ADC0 buffer overflow"},
    {5, "function not supported by the firmware"},
    {6, "watchdog time invalid"},
    {26, "memory block invalid"},
    {48, "the stream is running"},
    {49, "stream table invalid"},
    {50, "stream configuration invalid"},
    {52, "the stream is not running"},
    {53, "stream trigger invalid"},
    {54, "converter buffer overflow"},
    {55, "scan overlap: scans are faster than the converter"},
    {56, "number of samples invalid"},
    {57, "gain invalid"},
    {58, "scan rate invalid"},
    {59, "buffer overflow, recovering"},
    {60, "recovered from a buffer overflow"},
    {63, "too many scans lost to be counted"},
    {64, "timer invalid"},
    {96, "pin invalid"},
    {97, "pin is not analog"},
    {98, "pin is not digital"},
    {99, "operation lengths are inconsistent"},
    {100, "pin offset invalid"},
    {101, "operation unknown"},
};

}  // namespace

std::uint8_t checksum8(Bytes bytes) {
  unsigned sum = 0;
  for (const std::uint8_t byte : bytes) sum += byte;
  sum = (sum >> 8U) + (sum & 0xFFU);
  sum = (sum >> 8U) + (sum & 0xFFU);
  return static_cast<std::uint8_t>(sum);
}

std::uint16_t checksum16(Bytes bytes) {
  unsigned sum = 0;
  for (const std::uint8_t byte : bytes) sum += byte;
  return static_cast<std::uint16_t>(sum);
}

Command request_identity() { return extended_command(config_u6.number, 26); }

Command request_calibration(int block) {
  Command command;
  command.size = 8;
  command.bytes[7] = static_cast<std::uint8_t>(block);
  fill_header(command, read_cal.number);
  return command;
}

Command plain_lines() {
  Command command;
  command.size = 16;
  command.bytes[6] = 1;  // write: no timer, no counter, offset 0
  fill_header(command, config_io.number);
  return command;
}

Command start_stream() { return two_bytes(0xA8); }
Command stop_stream() { return two_bytes(0xB0); }

Command arm_watchdog(std::uint16_t timeout_s, int line) {
  Command command;
  command.size = 16;
  command.bytes[6] = 1;         // write
  command.bytes[7] = 1U << 4U;  // set a line when it expires; low: bit 7 of byte 10 stays 0
  command.bytes[8] = low(timeout_s);
  command.bytes[9] = high(timeout_s);
  command.bytes[10] = static_cast<std::uint8_t>(line & 0x0F);
  fill_header(command, watchdog.number);
  return command;
}

Command disarm_watchdog() {
  Command command;
  command.size = 16;
  command.bytes[6] = 1;
  command.bytes[8] = 60;  // without effect, but 0 would be an invalid time
  fill_header(command, watchdog.number);
  return command;
}

std::int64_t ScanClock::time_ns(std::uint64_t scan) const {
  // Whole seconds first: scans * 1e9 would soon overflow.
  const std::uint64_t ticks = scan * interval;
  const std::uint64_t seconds = ticks / hz;
  const std::uint64_t rest = ticks % hz;
  return static_cast<std::int64_t>(seconds * 1'000'000'000U +
                                   (rest * 1'000'000'000U + hz / 2) / hz);
}

double deviation(const ScanClock& clock, double rate_hz) {
  return std::abs(clock.rate_hz() / rate_hz - 1.0);
}

ScanClock nearest_clock(double rate_hz) {
  ScanClock best = clock_at(clock_kinds[0], rate_hz);
  for (const ClockKind& kind : clock_kinds) {
    const ScanClock candidate = clock_at(kind, rate_hz);
    if (deviation(candidate, rate_hz) < deviation(best, rate_hz) - 1e-15) best = candidate;
  }
  return best;
}

Command configure_stream(std::span<const StreamChannel> channels, int resolution_index,
                         int samples_per_packet, int settling, const ScanClock& clock) {
  Command command;
  command.size = 14 + 2 * channels.size();
  command.bytes[6] = static_cast<std::uint8_t>(channels.size());
  command.bytes[7] = static_cast<std::uint8_t>(resolution_index);
  command.bytes[8] = static_cast<std::uint8_t>(samples_per_packet);
  command.bytes[10] = static_cast<std::uint8_t>(settling);
  command.bytes[11] = clock.config_bits;
  command.bytes[12] = low(clock.interval);
  command.bytes[13] = high(clock.interval);
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const StreamChannel& channel = channels[i];
    command.bytes[14 + 2 * i] = channel.input;
    command.bytes[15 + 2 * i] =
        static_cast<std::uint8_t>((channel.differential ? 0x80U : 0U) | (channel.gain & 3U) << 4U);
  }
  fill_header(command, stream_config.number);
  return command;
}

Feedback::Feedback(std::uint8_t echo) {
  command_.size = 7;
  command_.bytes[6] = echo;
}

void Feedback::add(std::initializer_list<std::uint8_t> bytes) {
  if (command_.size + bytes.size() > largest_packet) return;
  for (const std::uint8_t byte : bytes) command_.bytes[command_.size++] = byte;
}

Feedback& Feedback::dac(int dac, std::uint16_t counts) {
  add({static_cast<std::uint8_t>(38 + (dac & 1)), low(counts), high(counts)});
  return *this;
}

Feedback& Feedback::set_line(int line, bool is_high) {
  add({11, static_cast<std::uint8_t>((line & 0x1F) | (is_high ? 0x80 : 0))});
  return *this;
}

Feedback& Feedback::make_input(int line) {
  add({13, static_cast<std::uint8_t>(line & 0x1F)});
  return *this;
}

Feedback& Feedback::read_lines() {
  add({26});
  return *this;
}

Command Feedback::command() const {
  Command command = command_;
  command.size += command.size % 2;  // the pad byte is 0, an operation without effect
  fill_header(command, feedback_function);
  return command;
}

const char* error_name(std::uint8_t code) {
  const auto* const found =
      std::find_if(std::begin(named_errors), std::end(named_errors),
                   [code](const NamedError& error) { return error.code == code; });
  return found != std::end(named_errors) ? found->name : "unknown error";
}

std::string in_words(const Verdict& verdict) {
  switch (verdict.kind) {
    case Verdict::Kind::ok:
      return "no error";
    case Verdict::Kind::length:
      return "a reply of wrong length";
    case Verdict::Kind::checksum:
      return "a reply with a wrong checksum";
    case Verdict::Kind::refused:
      return "it received a corrupted command";
    case Verdict::Kind::command:
      return "the reply to another command";
    case Verdict::Kind::error:
      break;
  }
  return "error " + std::to_string(verdict.code) + " (" + error_name(verdict.code) + ")";
}

Verdict parse_identity(Bytes reply, Identity& identity) {
  if (const Verdict verdict = check_extended(reply, config_u6); !verdict) return verdict;
  identity.firmware_minor = reply[9];
  identity.firmware_major = reply[10];
  identity.serial = double_word_at(reply, 15);
  identity.product = word_at(reply, 19);
  identity.pro = (reply[37] & 8U) != 0;
  return {};
}

std::string name_of(const Identity& identity) {
  return std::string(identity.pro ? "LabJack U6-Pro #" : "LabJack U6 #") +
         std::to_string(identity.serial);
}

std::string firmware_of(const Identity& identity) {
  char text[16];
  std::snprintf(text, sizeof text, "%d.%02d", identity.firmware_major, identity.firmware_minor);
  return text;
}

Verdict parse_calibration(Bytes reply, CalibrationBlock& block) {
  if (const Verdict verdict = check_extended(reply, read_cal); !verdict) return verdict;
  std::copy(reply.begin() + 8, reply.begin() + 40, block.begin());
  return {};
}

Verdict check_plain_lines(Bytes reply) { return check_extended(reply, config_io); }
Verdict check_stream_configured(Bytes reply) { return check_extended(reply, stream_config); }
Verdict check_stream_started(Bytes reply) { return check_four_bytes(reply, 0xA9); }
Verdict check_stream_stopped(Bytes reply) { return check_four_bytes(reply, 0xB1); }
Verdict check_watchdog(Bytes reply) { return check_extended(reply, watchdog); }

Verdict parse_feedback(Bytes reply, bool lines_read, FeedbackReply& out) {
  if (const Verdict frame = check_frame(reply, feedback_function); !frame) return frame;
  if (reply.size() <= 8) return {Verdict::Kind::length};
  out.echo = reply[8];
  if (reply[6] != 0) return {Verdict::Kind::error, reply[6], reply[7]};
  const std::size_t bytes = feedback_data_at + (lines_read ? port_bytes : 0);
  if (reply.size() != bytes + bytes % 2) return {Verdict::Kind::length};
  out.lines = 0;
  if (lines_read) {
    out.lines = static_cast<std::uint32_t>(word_at(reply, feedback_data_at)) |
                static_cast<std::uint32_t>(reply[feedback_data_at + 2]) << 16U;
  }
  return {};
}

Calibration nominal_calibration() {
  Calibration nominal;
  static_cast<labjack::ConverterCalibration&>(nominal) = labjack::nominal_converter();
  nominal.dac_slope = {13200.0, 13200.0};
  return nominal;
}

Calibration calibration_of(std::span<const CalibrationBlock, calibration_blocks> blocks) {
  // Four constants in a block: slope and offset of gains 0 to 3 for positive voltages, slope and
  // center of gains 0 to 3 for negative ones, slope and offset of both DACs. The offset for
  // positive voltages is redundant with the center.
  const auto constant = [&](std::size_t index) {
    return fixed_point(Bytes(blocks[index / 4]).subspan(index % 4 * 8, 8));
  };
  Calibration calibration;
  for (std::size_t gain = 0; gain < gain_count; ++gain) {
    calibration.positive_slope_v[gain] = constant(2 * gain);
    calibration.negative_slope_v[gain] = constant(8 + 2 * gain);
    calibration.center[gain] = constant(9 + 2 * gain);
  }
  for (std::size_t dac = 0; dac < 2; ++dac) {
    calibration.dac_slope[dac] = constant(16 + 2 * dac);
    calibration.dac_offset[dac] = constant(17 + 2 * dac);
  }
  return calibration;
}

std::string implausible_constant(const Calibration& calibration) {
  if (std::string text = labjack::implausible_constant(calibration); !text.empty()) return text;
  const Calibration nominal = nominal_calibration();
  for (std::size_t dac = 0; dac < 2; ++dac) {
    const int index = static_cast<int>(dac);
    if (!labjack::within(calibration.dac_slope[dac], nominal.dac_slope[dac], 660.0)) {
      return labjack::implausible("the slope of DAC", index, calibration.dac_slope[dac],
                                  nominal.dac_slope[dac]);
    }
    if (!labjack::within(calibration.dac_offset[dac], 0.0, 1000.0)) {
      return labjack::implausible("the offset of DAC", index, calibration.dac_offset[dac], 0.0);
    }
  }
  return {};
}

std::uint16_t dac_counts(const Calibration& calibration, int dac, double volts) {
  const auto which = static_cast<std::size_t>(dac & 1);
  const double wanted = std::isfinite(volts) ? volts : 0.0;
  const double counts = calibration.dac_slope[which] * wanted + calibration.dac_offset[which];
  return static_cast<std::uint16_t>(std::clamp(std::round(counts), 0.0, 65535.0));
}

}  // namespace stickslip::drivers::labjack_u6
