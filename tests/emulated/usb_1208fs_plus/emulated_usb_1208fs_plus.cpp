// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/usb_1208fs_plus/emulated_usb_1208fs_plus.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

namespace stickslip::emulated {

namespace {

constexpr std::size_t packet_bytes = 64;
constexpr double pacer_hz = 60.0e6;
constexpr std::array<double, 8> ranges_v = {20.0, 10.0, 5.0, 4.0, 2.5, 2.0, 1.25, 1.0};
constexpr int single_ended_range = 1;  // +-10 V, whatever is requested
constexpr std::size_t calibration_bytes = 0x300;
constexpr std::size_t single_ended_at = 0x100;
constexpr std::size_t date_at = 0x200;
constexpr std::size_t user_bytes = 256;
constexpr std::size_t differential_channels = 4;
constexpr std::int64_t never = std::numeric_limits<std::int64_t>::max();

enum Request : std::uint8_t {
  ain = 0x10,
  ain_scan_start = 0x11,
  ain_scan_stop = 0x12,
  ain_config = 0x14,
  ain_clear_fifo = 0x15,
  ain_bulk_flush = 0x16,
  aout = 0x18,
  aout_scan_start = 0x1A,
  aout_scan_stop = 0x1B,
  aout_clear_fifo = 0x1C,
  counter = 0x20,
  calibration_memory_request = 0x30,
  user_memory_request = 0x31,
  blink = 0x41,
  restart = 0x42,
  status_request = 0x44,
  serial_request = 0x48,
};

std::uint32_t double_word(std::span<const std::uint8_t> bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 4; i-- > 0;) value = value << 8U | bytes[at + i];
  return value;
}

void put_float(Bytes& bytes, std::size_t at, float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  for (std::size_t i = 0; i < 4; ++i) {
    bytes[at + i] = static_cast<std::uint8_t>(bits >> (8 * i) & 0xFFU);
  }
}

Bytes part_of(const Bytes& memory, std::size_t from, std::size_t count) {
  const std::size_t begin = std::min(from, memory.size());
  const std::size_t end = std::min(begin + count, memory.size());
  return {memory.begin() + static_cast<std::ptrdiff_t>(begin),
          memory.begin() + static_cast<std::ptrdiff_t>(end)};
}

}  // namespace

EmulatedUsb1208fsPlus::EmulatedUsb1208fsPlus(Options options, Wires& wires, Now now)
    : options_(std::move(options)),
      wires_(wires),
      now_(std::move(now)),
      calibration_(calibration_bytes, 0),
      user_memory_(user_bytes, 0),
      noise_(options_.seed),
      fate_(options_.seed + 1) {
  write_calibration();
  reset();
}

void EmulatedUsb1208fsPlus::write_calibration() {
  std::mt19937_64 random(options_.seed + 2);
  std::uniform_real_distribution<float> slope(0.98F, 1.02F);
  std::uniform_real_distribution<float> offset(-12.0F, 12.0F);
  const auto put = [&](std::size_t at) {
    put_float(calibration_, at, options_.imperfect ? slope(random) : 1.0F);
    put_float(calibration_, at + 4, options_.imperfect ? offset(random) : 0.0F);
  };
  for (std::size_t i = 0; i < ranges_v.size() * differential_channels; ++i) put(8 * i);
  for (std::size_t i = 0; i < terminals; ++i) put(single_ended_at + 8 * i);
  const Bytes date{24, 5, 17, 10, 30, 0};
  std::copy(date.begin(), date.end(), calibration_.begin() + date_at);
}

EmulatedUsb1208fsPlus::Correction EmulatedUsb1208fsPlus::correction(std::size_t channel,
                                                                    bool differential,
                                                                    int range) const {
  const std::size_t at =
      differential ? 8 * (static_cast<std::size_t>(range) * differential_channels + channel)
                   : single_ended_at + 8 * channel;
  return {std::bit_cast<float>(double_word(calibration_, at)),
          std::bit_cast<float>(double_word(calibration_, at + 4))};
}

Bytes EmulatedUsb1208fsPlus::device_descriptor() const {
  return {18, 1, 0x00, 0x02, 0xFF, 0, 0, 64, 0xDB, 0x09, 0xE8, 0x00, 0x00, 0x01, 1, 2, 3, 1};
}

Bytes EmulatedUsb1208fsPlus::configuration_descriptor() const {
  return {9, 2, 32,   0, 1,  1,    0, 0x80, 250,  // configuration
          9, 4, 0,    0, 2,  0xFF, 0, 0,    0,    // vendor-specific interface
          7, 5, 0x81, 2, 64, 0,    0,             // bulk in
          7, 5, 0x02, 2, 64, 0,    0};            // bulk out
}

std::string EmulatedUsb1208fsPlus::string(std::uint8_t index) const {
  switch (index) {
    case 1:
      return "Measurement Computing Corp.";
    case 2:
      return "USB-1208FS-Plus";
    case 3:
      return options_.serial;
    default:
      return {};
  }
}

UsbAnswer EmulatedUsb1208fsPlus::control(const UsbSetup& setup, std::span<const std::uint8_t> out) {
  catch_up();
  if (setup.request_type == 0xC0) return read(setup);
  if (setup.request_type == 0x40) return {write(setup, out), {}};
  return {UsbStatus::stall, {}};
}

UsbAnswer EmulatedUsb1208fsPlus::read(const UsbSetup& setup) {
  Bytes bytes;
  const auto put = [&bytes](std::uint16_t word) {
    bytes.push_back(static_cast<std::uint8_t>(word & 0xFFU));
    bytes.push_back(static_cast<std::uint8_t>(word >> 8U));
  };
  switch (setup.request) {
    case ain: {
      const std::size_t channel = setup.value & 0xFFU;
      const bool differential = setup.value >> 8U != 0;
      if (input_.running || setup.index >= ranges_v.size() ||
          channel >= (differential ? differential_channels : terminals)) {
        return {UsbStatus::stall, {}};
      }
      put(convert(channel, differential, setup.index, now_()));
      break;
    }
    case ain_config:
      bytes.assign(ranges_.begin(), ranges_.end());
      break;
    case aout:
      for (const std::uint16_t counts : counts_) put(counts);
      break;
    case counter:
      bytes.assign(4, 0);
      break;
    case calibration_memory_request:
      bytes = part_of(calibration_, setup.value, setup.length);
      break;
    case user_memory_request:
      bytes = part_of(user_memory_, setup.value, setup.length);
      break;
    case status_request:
      put(status());
      break;
    case serial_request:
      bytes.assign(options_.serial.begin(), options_.serial.end());
      bytes.resize(8, '0');
      break;
    default:
      return {UsbStatus::stall, {}};
  }
  bytes.resize(std::min<std::size_t>(bytes.size(), setup.length));
  return {UsbStatus::ok, std::move(bytes)};
}

UsbStatus EmulatedUsb1208fsPlus::write(const UsbSetup& setup, std::span<const std::uint8_t> out) {
  switch (setup.request) {
    case ain_scan_start:
      return start_input(out);
    case ain_scan_stop:
      input_.running = false;
      return UsbStatus::ok;
    case ain_config:
      if (input_.running || out.size() != ranges_.size() ||
          std::any_of(out.begin(), out.end(), [](auto range) { return range > 7; })) {
        return UsbStatus::stall;
      }
      std::copy(out.begin(), out.end(), ranges_.begin());
      return UsbStatus::ok;
    case ain_clear_fifo:
      clear_input_fifo();
      return UsbStatus::ok;
    case ain_bulk_flush:
      for (int i = out.empty() ? 0 : out[0]; i > 0; --i) input_.packets.emplace_back();
      return UsbStatus::ok;
    case aout:
      if (output_.running || setup.index > 1 || setup.value > 0xFFF) return UsbStatus::stall;
      set_output(setup.index, setup.value, now_());
      return UsbStatus::ok;
    case aout_scan_start:
      return start_output(out);
    case aout_scan_stop:
      output_.running = false;
      output_.taken_of_transfer = 0;
      return UsbStatus::ok;
    case aout_clear_fifo:
      output_.fifo.clear();
      output_.taken_of_transfer = 0;
      return UsbStatus::ok;
    case user_memory_request:
      if (setup.value + out.size() > user_memory_.size()) return UsbStatus::stall;
      std::copy(out.begin(), out.end(), user_memory_.begin() + setup.value);
      return UsbStatus::ok;
    case counter:
    case blink:
      return UsbStatus::ok;
    case restart:
      reset();
      return UsbStatus::ok;
    default:
      return UsbStatus::stall;
  }
}

std::uint16_t EmulatedUsb1208fsPlus::status() const {
  return static_cast<std::uint16_t>((input_.running ? 2 : 0) | (input_.overrun ? 4 : 0) |
                                    (output_.running ? 8 : 0) | (output_.underrun ? 16 : 0));
}

UsbStatus EmulatedUsb1208fsPlus::start_input(std::span<const std::uint8_t> out) {
  if (out.size() != 14 || input_.running || input_.halted) return UsbStatus::stall;
  const std::uint32_t pacer = double_word(out, 8);
  const std::uint8_t options = out[13];
  const bool differential = (options & 2U) != 0;
  const auto mask = static_cast<std::uint8_t>(out[12] & (differential ? 0x0FU : 0xFFU));
  const double rate_hz = pacer_hz / (static_cast<double>(pacer) + 1.0);
  if (pacer == 0 || mask == 0 || rate_hz > 52000.0) return UsbStatus::stall;
  InputScan scan;
  scan.running = true;
  scan.differential = differential;
  scan.immediate = (options & 1U) != 0;
  scan.never_stalls = (options & 0x80U) != 0;
  for (std::size_t channel = 0; channel < terminals; ++channel) {
    if ((mask >> channel & 1U) != 0) scan.channels.push_back(channel);
  }
  scan.samples_wanted = double_word(out, 0);
  scan.pace = {now_(), 1.0e9 / (rate_hz * (1.0 + options_.crystal)), 0};
  // Unread data of the previous scan come first.
  scan.packets = std::move(input_.packets);
  scan.filling = std::move(input_.filling);
  scan.bytes = input_.bytes;
  input_ = std::move(scan);
  return UsbStatus::ok;
}

void EmulatedUsb1208fsPlus::clear_input_fifo() {
  input_.packets.clear();
  input_.filling.clear();
  input_.bytes = 0;
  again_.reset();
}

UsbStatus EmulatedUsb1208fsPlus::start_output(std::span<const std::uint8_t> out) {
  if (out.size() != 9 || output_.running || output_.halted) return UsbStatus::stall;
  const double rate_hz = pacer_hz / (static_cast<double>(double_word(out, 4)) + 1.0);
  const auto mask = static_cast<std::uint8_t>(out[8] & 3U);
  if (mask == 0 || rate_hz > 50000.5) return UsbStatus::stall;
  output_.running = true;
  output_.waiting = true;
  output_.underrun = false;
  output_.never_stalls = (out[8] & 0x80U) != 0;
  output_.mask = mask;
  output_.scans_wanted = double_word(out, 0);
  output_.done = 0;
  output_.pace = {0, 1.0e9 / (rate_hz * (1.0 + options_.crystal)), 0};
  start_output_if_ready();
  return UsbStatus::ok;
}

void EmulatedUsb1208fsPlus::start_output_if_ready() {
  const auto scan_bytes = static_cast<std::size_t>(2 * std::popcount(output_.mask));
  if (!output_.running || !output_.waiting || output_.fifo.size() < scan_bytes) return;
  output_.waiting = false;
  output_.pace.start_ns = now_();
  catch_up();
}

/// Performs all due actions in order.
void EmulatedUsb1208fsPlus::catch_up() {
  if (!plugged_) return;
  const std::int64_t now_ns = now_();
  while (true) {
    const std::int64_t out_ns = output_.running && !output_.waiting ? output_.pace.due_ns() : never;
    const std::int64_t in_ns = input_.running ? input_.pace.due_ns() : never;
    if (std::min(out_ns, in_ns) > now_ns) return;
    if (out_ns <= in_ns) {
      put_scan();
    } else {
      take_sample();
    }
  }
}

void EmulatedUsb1208fsPlus::take_sample() {
  const std::int64_t time_ns = input_.pace.due_ns();
  const std::size_t place = input_.pace.ticks++ % input_.channels.size();
  const std::size_t channel = input_.channels[place];
  const double volts = input_v(channel, input_.differential, time_ns);
  record(place, time_ns, volts);
  if (input_.bytes + 2 > options_.input_fifo_bytes) {
    input_.overrun = true;
    ++injected_.input_samples_dropped;
    if (!input_.never_stalls) {
      input_.running = false;
      input_.halted = true;
    }
    return;
  }
  keep(code(channel, input_.differential, ranges_[channel], volts));
  if (++input_.samples_taken == input_.samples_wanted) {
    finish_input();
    return;
  }
  const bool last = place + 1 == input_.channels.size();
  if (last && input_.immediate && !input_.filling.empty()) {
    input_.packets.push_back(std::exchange(input_.filling, {}));
  }
}

void EmulatedUsb1208fsPlus::record(std::size_t place, std::int64_t time_ns, double volts) {
  if (place == 0) scans_.push_back({time_ns, {}, input_.pace.ticks == 1});
  scans_.back().volts.push_back(volts);
}

void EmulatedUsb1208fsPlus::keep(std::uint16_t code) {
  input_.filling.push_back(static_cast<std::uint8_t>(code & 0xFFU));
  input_.filling.push_back(static_cast<std::uint8_t>(code >> 8U));
  input_.bytes += 2;
  if (input_.filling.size() == packet_bytes) {
    input_.packets.push_back(std::exchange(input_.filling, {}));
  }
}

/// Sends the rest as a short packet, or an empty one as the end.
void EmulatedUsb1208fsPlus::finish_input() {
  input_.running = false;
  input_.packets.push_back(std::exchange(input_.filling, {}));
}

void EmulatedUsb1208fsPlus::put_scan() {
  const std::int64_t time_ns = output_.pace.due_ns();
  const auto scan_bytes = static_cast<std::size_t>(2 * std::popcount(output_.mask));
  if (output_.fifo.size() < scan_bytes) {
    output_.underrun = true;
    output_.running = false;
    output_.halted = !output_.never_stalls;
    return;
  }
  ++output_.pace.ticks;
  for (std::size_t output = 0; output < counts_.size(); ++output) {
    if ((output_.mask >> output & 1U) == 0) continue;
    const auto counts =
        static_cast<std::uint16_t>((output_.fifo[0] | output_.fifo[1] << 8) & 0xFFF);
    output_.fifo.erase(output_.fifo.begin(), output_.fifo.begin() + 2);
    set_output(output, counts, time_ns);
  }
  if (++output_.done == output_.scans_wanted) output_.running = false;
}

void EmulatedUsb1208fsPlus::set_output(std::size_t output, std::uint16_t counts,
                                       std::int64_t time_ns) {
  if (outputs_stuck_) return;
  counts_[output] = counts;
  if (output == options_.output) wires_.drive(output_v(output), time_ns);
}

double EmulatedUsb1208fsPlus::output_v(std::size_t output) const {
  return counts_[output] * 5.0 / 4096.0;
}

double EmulatedUsb1208fsPlus::terminal_v(std::size_t terminal, std::int64_t time_ns) {
  if (terminal == options_.output_terminal) return output_v(options_.output);
  if (terminal == options_.contact_terminal) return options_.contact_closed() ? 5.0 : 0.0;
  const auto& sensor = options_.sensors[terminal];
  return sensor ? (*sensor)(wires_, time_ns) : 0.0;
}

double EmulatedUsb1208fsPlus::input_v(std::size_t channel, bool differential,
                                      std::int64_t time_ns) {
  double volts = differential
                     ? terminal_v(2 * channel, time_ns) - terminal_v(2 * channel + 1, time_ns)
                     : terminal_v(channel, time_ns);
  if (options_.noise_v > 0.0) {
    volts += std::normal_distribution<double>(0.0, options_.noise_v)(noise_);
  }
  return volts;
}

std::uint16_t EmulatedUsb1208fsPlus::convert(std::size_t channel, bool differential, int range,
                                             std::int64_t time_ns) {
  return code(channel, differential, range, input_v(channel, differential, time_ns));
}

std::uint16_t EmulatedUsb1208fsPlus::code(std::size_t channel, bool differential, int range,
                                          double volts) const {
  const int used = differential ? range : single_ended_range;
  const double truth = volts * 2048.0 / ranges_v[static_cast<std::size_t>(used)] + 2048.0;
  const Correction needed = correction(channel, differential, used);
  const double exact = (truth - needed.offset) / needed.slope;
  // Single-ended inputs have eleven bits.
  const double step = differential ? 1.0 : 2.0;
  return static_cast<std::uint16_t>(
      std::clamp(std::round(exact / step) * step, 0.0, 4096.0 - step));
}

UsbStatus EmulatedUsb1208fsPlus::out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) {
  catch_up();
  if (endpoint != 2 || output_.halted) return UsbStatus::stall;
  // A transfer that exceeded the FIFO continues where it stopped.
  if (output_.taken_of_transfer > bytes.size()) output_.taken_of_transfer = 0;
  while (output_.taken_of_transfer < bytes.size()) {
    const std::size_t rest = bytes.size() - output_.taken_of_transfer;
    const std::size_t packet = std::min(packet_bytes, rest);
    if (output_.fifo.size() + packet > options_.output_fifo_bytes) return UsbStatus::not_ready;
    const auto part = bytes.subspan(output_.taken_of_transfer, packet);
    output_.fifo.insert(output_.fifo.end(), part.begin(), part.end());
    output_.taken_of_transfer += packet;
    start_output_if_ready();
  }
  output_.taken_of_transfer = 0;
  return UsbStatus::ok;
}

UsbAnswer EmulatedUsb1208fsPlus::in(std::uint8_t endpoint, std::size_t capacity) {
  catch_up();
  if (endpoint != 1) return {UsbStatus::stall, {}};
  if (std::exchange(faults.stall, false)) {
    input_.halted = true;
    ++injected_.stall;
  }
  if (input_.halted) return {UsbStatus::stall, {}};
  if (faults.silence) return {UsbStatus::not_ready, {}};
  UsbAnswer answer{UsbStatus::not_ready, {}};
  Bytes packet;
  while (answer.bytes.size() + packet_bytes <= capacity && next_packet(packet)) {
    answer.status = UsbStatus::ok;
    answer.bytes.insert(answer.bytes.end(), packet.begin(), packet.end());
    if (packet.size() < packet_bytes) break;
  }
  // A request for less than a packet loses the rest of it.
  if (answer.status == UsbStatus::not_ready && capacity < packet_bytes && next_packet(packet)) {
    packet.resize(std::min(packet.size(), capacity));
    answer = {UsbStatus::ok, packet};
  }
  return answer;
}

bool EmulatedUsb1208fsPlus::next_packet(Bytes& packet) {
  if (again_) {
    packet = *std::exchange(again_, std::nullopt);
    return true;
  }
  while (!input_.packets.empty()) {
    packet = std::move(input_.packets.front());
    input_.packets.pop_front();
    input_.bytes -= std::min(input_.bytes, packet.size());
    if (chance(faults.lost_packet, injected_.lost_packet)) continue;
    if (chance(faults.repeated_packet, injected_.repeated_packet)) again_ = packet;
    if (packet.size() > 2 && chance(faults.short_packet, injected_.short_packet)) {
      packet.resize(2 * (1 + fate_() % (packet.size() / 2 - 1)));
    }
    return true;
  }
  return false;
}

void EmulatedUsb1208fsPlus::clear_halt(std::uint8_t endpoint_address) {
  catch_up();
  if (endpoint_address == 0x81) input_.halted = false;
  if (endpoint_address == 0x02) output_.halted = false;
}

void EmulatedUsb1208fsPlus::reset() {
  plugged_ = true;
  input_ = {};
  output_ = {};
  again_.reset();
  ranges_ = {};
  outputs_stuck_ = false;  // without power every output is at 0 V
  for (std::size_t output = 0; output < counts_.size(); ++output) set_output(output, 0, now_());
}

void EmulatedUsb1208fsPlus::set_outputs_stuck(bool stuck) {
  catch_up();
  outputs_stuck_ = stuck;
}

void EmulatedUsb1208fsPlus::unplug() {
  catch_up();
  reset();
  plugged_ = false;
}

bool EmulatedUsb1208fsPlus::chance(double probability, std::uint64_t& count) {
  if (probability <= 0.0) return false;
  const bool strikes = std::uniform_real_distribution<double>(0.0, 1.0)(fate_) < probability;
  if (strikes) ++count;
  return strikes;
}

}  // namespace stickslip::emulated
