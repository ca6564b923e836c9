// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/labjack_u6/emulated_labjack_u6.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "tests/emulated/labjack_u6/wire.h"

namespace stickslip::emulated {

namespace {

using u6::get16;
using u6::put16;

constexpr int lines = 20;
constexpr std::uint8_t in_endpoint = 2;
constexpr std::uint8_t stream_endpoint = 3;

enum Error : std::uint8_t {
  no_error = 0,
  function_invalid = 5,
  watchdog_time = 6,
  invalid_block = 26,
  stream_active = 48,
  stream_table_invalid = 49,
  stream_config_invalid = 50,
  stream_not_running = 52,
  samples_per_packet_invalid = 56,
  gain_invalid = 57,
  scan_rate_invalid = 58,
  timer_invalid = 64,
  analog_pin_invalid = 97,
  digital_pin_invalid = 98,
  io_type_out_of_step = 99,
  io_type_invalid = 101,
};

/// An extended answer of that length, with its error and no checksums yet.
Bytes extended(std::size_t length, std::uint8_t command, std::uint8_t error) {
  Bytes bytes(length);
  bytes[1] = 0xF8;
  bytes[3] = command;
  bytes[6] = error;
  return bytes;
}

/// As stream channels and AIN24 number them: the 14 inputs, temperature, ground.
bool analog_channel_exists(int channel) { return channel >= 0 && channel <= 15; }

bool may_be_differential(int channel) { return channel % 2 == 0 && channel <= 12; }

}  // namespace

struct EmulatedLabjackU6::Feedback {
  std::span<const std::uint8_t> bytes;  // what is left of the command
  std::int64_t time_ns = 0;             // waits make it later
  Bytes data;

  /// The bytes of an IOType, itself included; empty: the command ends before.
  std::span<const std::uint8_t> take(std::size_t count) {
    if (bytes.size() < count) return {};
    const auto taken = bytes.first(count);
    bytes = bytes.subspan(count);
    return taken;
  }
};

EmulatedLabjackU6::EmulatedLabjackU6(Wires& wires, Now now, LabjackU6Options options)
    : wires_(wires),
      now_(std::move(now)),
      options_(options),
      calibration_(u6_calibration_of_unit(options.seed)),
      noise_(options.seed ^ 0x0153EULL),
      chance_(options.seed ^ 0xC4A7CEULL),
      stream_([this](const U6StreamChannel& channel, std::int64_t time_ns,
                     double& volts) { return stream_counts(channel, time_ns, volts); },
              options.seed),
      local_id_(options.local_id) {}

void EmulatedLabjackU6::set_dac_stuck(bool stuck) {
  const std::lock_guard hold(lock_);
  dac_stuck_ = stuck;
}

void EmulatedLabjackU6::set_contact_stuck(bool stuck) {
  const std::lock_guard hold(lock_);
  contact_stuck_ = stuck;
  update_enable(now_());
}

void EmulatedLabjackU6::open_contact() {
  const std::lock_guard hold(lock_);
  enabled_ = false;
  contact_stuck_ = true;
  wires_.enable(false, now_());
}

void EmulatedLabjackU6::wire(int input, Sensor sensor) {
  const std::lock_guard hold(lock_);
  inputs_[input] = sensor;
}

Bytes EmulatedLabjackU6::device_descriptor() const {
  Bytes bytes = {18, 1, 0x00, 0x02, 0xFF, 0xFF, 0xFF, 64, 0, 0, 0, 0, 0x00, 0x01, 1, 2, 0, 1};
  put16(bytes, 8, vendor_id);
  put16(bytes, 10, product_id);
  return bytes;
}

Bytes EmulatedLabjackU6::configuration_descriptor() const {
  Bytes bytes = {9, 2, 0, 0, 1, 1, 0, 0x80, 250, 9, 4, 0, 0, 3, 0xFF, 0xFF, 0xFF, 0};
  constexpr std::array<std::uint8_t, 3> endpoints = {0x01, 0x82, 0x83};
  for (const std::uint8_t endpoint : endpoints) {
    const Bytes descriptor = {7, 5, endpoint, 2, 64, 0, 0};
    bytes.insert(bytes.end(), descriptor.begin(), descriptor.end());
  }
  put16(bytes, 2, static_cast<std::uint16_t>(bytes.size()));
  return bytes;
}

std::string EmulatedLabjackU6::string(std::uint8_t index) const {
  if (index == 1) return "LabJack Corporation";
  if (index == 2) return "LabJack U6";
  return {};
}

UsbAnswer EmulatedLabjackU6::control(const UsbSetup&, std::span<const std::uint8_t>) {
  return {UsbStatus::stall, {}};
}

void EmulatedLabjackU6::reset() {
  const std::lock_guard hold(lock_);
  power_up(now_());
}

void EmulatedLabjackU6::power_up(std::int64_t time_ns) {
  ++resets_;
  stream_.power_up();
  answers_.clear();
  response_stalled_ = false;
  watchdog_ = {};
  io_config_ = {};
  direction_ = latch_ = 0;
  for (std::size_t dac = 0; dac < dac_counts_.size(); ++dac) set_dac(dac, 0, time_ns);
  update_enable(time_ns);
}

void EmulatedLabjackU6::catch_up() {
  const std::lock_guard hold(lock_);
  catch_up_locked();
}

void EmulatedLabjackU6::catch_up_locked() {
  const std::int64_t now = now_();
  while (watchdog_.armed() && watchdog_.due_ns() <= now) {
    const std::int64_t due = watchdog_.due_ns();
    stream_.sample_until(due);
    trip_watchdog(due);
  }
  stream_.sample_until(now);
}

void EmulatedLabjackU6::trip_watchdog(std::int64_t time_ns) {
  ++trips_;
  const Watchdog watchdog = watchdog_;
  if ((watchdog.options & 0x20U) != 0) {
    power_up(time_ns);  // and the watchdog is off, as after power-up
  } else {
    watchdog_.fed_ns = time_ns;
  }
  if ((watchdog.options & 0x10U) != 0) {
    const std::uint32_t bit = 1U << (watchdog.dio & 0x0FU);
    direction_ |= bit;
    latch_ = (watchdog.dio & 0x80U) != 0 ? latch_ | bit : latch_ & ~bit;
    update_enable(time_ns);
  }
}

UsbStatus EmulatedLabjackU6::out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) {
  const std::lock_guard hold(lock_);
  catch_up_locked();
  if (endpoint != 1) return UsbStatus::stall;
  if (bytes.empty()) return UsbStatus::ok;
  ++commands_;
  watchdog_.fed_ns = now_();
  command(bytes);
  return UsbStatus::ok;
}

UsbAnswer EmulatedLabjackU6::in(std::uint8_t endpoint, std::size_t capacity) {
  const std::lock_guard hold(lock_);
  catch_up_locked();
  if (silent_) return {UsbStatus::not_ready, {}};
  if (endpoint == in_endpoint) {
    if (!answers_.empty() && answers_.front().stall_first) {
      answers_.front().stall_first = false;
      response_stalled_ = true;
    }
    if (response_stalled_) return {UsbStatus::stall, {}};
    if (answers_.empty() || answers_.front().ready_ns > now_()) return {UsbStatus::not_ready, {}};
    UsbAnswer reply{UsbStatus::ok, std::move(answers_.front().bytes)};
    answers_.pop_front();
    return reply;
  }
  if (endpoint != stream_endpoint) return {UsbStatus::stall, {}};
  if (stream_.stalled()) return {UsbStatus::stall, {}};
  UsbAnswer data{UsbStatus::not_ready, {}};
  while (data.bytes.size() + stream_.packet_bytes() <= capacity) {
    const auto packet = stream_.next_packet();
    if (!packet) break;
    data.status = UsbStatus::ok;
    data.bytes.insert(data.bytes.end(), packet->begin(), packet->end());
    if (packet->size() % 64 != 0) break;
  }
  if (data.status != UsbStatus::ok && stream_.stalled()) data.status = UsbStatus::stall;
  return data;
}

void EmulatedLabjackU6::clear_halt(std::uint8_t endpoint_address) {
  const std::lock_guard hold(lock_);
  if ((endpoint_address & 0x0FU) == in_endpoint) response_stalled_ = false;
  if ((endpoint_address & 0x0FU) == stream_endpoint) stream_.clear_halt();
}

// Commands.

void EmulatedLabjackU6::command(std::span<const std::uint8_t> bytes) {
  const Bytes bad_checksum = {0xB8, 0xB8};
  if (bytes.size() < 2) return answer(bad_checksum);
  if ((bytes[1] & 0x78U) == 0x78U) return extended_command(bytes);
  if (u6::checksum8(bytes.subspan(1)) != bytes[0]) return answer(bad_checksum);
  switch (bytes[1]) {
    case 0xA8:
      return answer(stream_command(true));
    case 0xB0:
      return answer(stream_command(false));
    case 0x99:
      return answer(reset_command(bytes));
    default: {
      Bytes refusal = {0, bytes[1], 0, function_invalid};
      u6::seal_normal(refusal);
      return answer(std::move(refusal));
    }
  }
}

void EmulatedLabjackU6::extended_command(std::span<const std::uint8_t> bytes) {
  const bool valid = bytes.size() >= 8 && bytes.size() <= 64 &&
                     bytes.size() == 6 + 2 * std::size_t{bytes[2]} &&
                     u6::checksum8(bytes.subspan(1, 5)) == bytes[0] &&
                     u6::checksum16(bytes.subspan(6)) == get16(bytes, 4);
  if (!valid) return answer({0xB8, 0xB8});
  const auto reply = [&]() -> Bytes {
    switch (bytes[3]) {
      case 0x00:
        return feedback(bytes);
      case 0x08:
        return config_u6(bytes);
      case 0x09:
        return watchdog_command(bytes);
      case 0x0B:
        return config_io(bytes);
      case 0x11:
        return stream_config(bytes);
      case 0x2A:
        return read_memory(bytes, false);
      case 0x2D:
        return read_memory(bytes, true);
      default:
        return extended(8, bytes[3], function_invalid);
    }
  };
  // An injected error replaces the effect of the command.
  if (const std::uint8_t error = injected_error(); error != no_error) {
    Bytes refusal = extended(bytes[3] == 0x00 ? 10 : 8, bytes[3], error);
    if (bytes[3] == 0x00) {
      refusal[7] = 1;
      refusal[8] = bytes[6];
    }
    u6::seal_extended(refusal);
    return answer(std::move(refusal));
  }
  Bytes sealed = reply();
  u6::seal_extended(sealed);
  answer(std::move(sealed));
}

std::uint8_t EmulatedLabjackU6::injected_error() {
  const auto found = reply_faults_.find(replies_);
  if (found != reply_faults_.end() && found->second.first == U6ReplyFault::error) {
    return found->second.second.error;
  }
  const auto chance = reply_chances_.find(U6ReplyFault::error);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  if (chance != reply_chances_.end() && uniform(chance_) < chance->second.first) {
    return chance->second.second.error;
  }
  return no_error;
}

EmulatedLabjackU6::ReplyFate EmulatedLabjackU6::fate_of_reply() {
  const std::uint64_t number = replies_++;
  if (const auto found = reply_faults_.find(number); found != reply_faults_.end()) {
    const ReplyFate fate{found->second.first, found->second.second};
    reply_faults_.erase(found);
    return fate;
  }
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (const auto& [fault, chance] : reply_chances_) {
    if (fault != U6ReplyFault::error && uniform(chance_) < chance.first) {
      return {fault, chance.second};
    }
  }
  return {};
}

void EmulatedLabjackU6::answer(Bytes bytes) {
  const ReplyFate fate = fate_of_reply();
  Answer answer{std::move(bytes), now_(), false};
  if (fate.fault == U6ReplyFault::missing) return;
  if (fate.fault == U6ReplyFault::late) answer.ready_ns += fate.detail.late_ns;
  if (fate.fault == U6ReplyFault::stall) answer.stall_first = true;
  if (fate.fault == U6ReplyFault::bad_checksum) {
    answer.bytes[0] = static_cast<std::uint8_t>(answer.bytes[0] ^ 0xFFU);
  }
  answers_.push_back(std::move(answer));
}

Bytes EmulatedLabjackU6::config_u6(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != 26) return extended(38, 0x08, function_invalid);
  if ((bytes[6] & 0x08U) != 0) local_id_ = bytes[8];
  Bytes reply = extended(38, 0x08, no_error);
  reply[9] = options_.firmware_minor;
  reply[10] = options_.firmware_major;
  reply[11] = 15;
  reply[12] = 6;
  reply[13] = 0;
  reply[14] = 2;
  put16(reply, 15, static_cast<std::uint16_t>(options_.serial));
  put16(reply, 17, static_cast<std::uint16_t>(options_.serial >> 16U));
  put16(reply, 19, product_id);
  reply[21] = local_id_;
  reply[37] = options_.pro ? 12 : 4;
  return reply;
}

Bytes EmulatedLabjackU6::config_io(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != 16) return extended(16, 0x0B, function_invalid);
  if ((bytes[6] & 0x01U) != 0) io_config_ = {bytes[7], bytes[8], bytes[9]};
  Bytes reply = extended(16, 0x0B, no_error);
  std::copy(io_config_.begin(), io_config_.end(), reply.begin() + 8);
  return reply;
}

Bytes EmulatedLabjackU6::read_memory(std::span<const std::uint8_t> bytes, bool calibration) {
  const std::uint8_t command = calibration ? 0x2D : 0x2A;
  Bytes reply = extended(40, command, no_error);
  if (stream_.running()) {
    reply[6] = stream_active;
    return reply;
  }
  const std::size_t block = bytes[7];
  if (block >= u6_calibration_blocks) {
    reply[6] = invalid_block;
    return reply;
  }
  const Bytes held = calibration ? u6_calibration_block(calibration_, block, options_.pro)
                                 : Bytes(32, 0xFF);  // nothing was stored
  std::copy(held.begin(), held.end(), reply.begin() + 8);
  return reply;
}

Bytes EmulatedLabjackU6::stream_config(std::span<const std::uint8_t> bytes) {
  Bytes reply = extended(8, 0x11, no_error);
  if (stream_.running()) {
    reply[6] = stream_active;
    return reply;
  }
  U6StreamConfig config;
  const std::size_t channels = bytes.size() > 6 ? bytes[6] : 0;
  const auto refuse = [&reply](std::uint8_t error) {
    reply[6] = error;
    return reply;
  };
  if (channels == 0 || channels > 25) return refuse(stream_table_invalid);
  if (bytes.size() != 14 + 2 * channels) return refuse(stream_table_invalid);
  config.resolution_index = bytes[7];
  config.samples_per_packet = bytes[8];
  config.settling = bytes[10];
  if (config.resolution_index > 8 || config.settling > 8) return refuse(stream_config_invalid);
  if (config.samples_per_packet < 1 || config.samples_per_packet > 25) {
    return refuse(samples_per_packet_invalid);
  }
  config.clock_hz = (bytes[11] & 0x08U) != 0 ? 48e6 : 4e6;
  if ((bytes[11] & 0x02U) != 0) config.clock_hz /= 256.0;
  config.interval = get16(bytes, 12);
  if (config.interval == 0) return refuse(scan_rate_invalid);
  for (std::size_t i = 0; i < channels; ++i) {
    const std::uint8_t channel = bytes[14 + 2 * i];
    const std::uint8_t options = bytes[15 + 2 * i];
    const bool differential = (options & 0x80U) != 0;
    if (!analog_channel_exists(channel) || (differential && !may_be_differential(channel))) {
      return refuse(stream_table_invalid);
    }
    if ((options & 0x40U) != 0) return refuse(gain_invalid);
    config.channels.push_back({channel, differential, (options >> 4U) & 0x03});
  }
  stream_.configure(config);
  return reply;
}

Bytes EmulatedLabjackU6::stream_command(bool start) {
  std::uint8_t error = injected_error();
  if (error == no_error && start) {
    if (stream_.running()) {
      error = stream_active;
    } else if (!stream_.configured()) {
      error = stream_config_invalid;
    } else {
      stream_.start(now_(), options_.crystal_error_ppm * 1e-6);
    }
  } else if (error == no_error) {
    if (!stream_.running()) error = stream_not_running;
    stream_.stop();
  }
  Bytes reply = {0, static_cast<std::uint8_t>(start ? 0xA9 : 0xB1), error, 0};
  u6::seal_normal(reply);
  return reply;
}

Bytes EmulatedLabjackU6::reset_command(std::span<const std::uint8_t> bytes) {
  const bool known = bytes.size() == 4 && (bytes[2] == 1 || bytes[2] == 2);
  if (known) power_up(now_());
  Bytes reply = {0, 0x99, 0, static_cast<std::uint8_t>(known ? no_error : function_invalid)};
  u6::seal_normal(reply);
  return reply;
}

Bytes EmulatedLabjackU6::watchdog_command(std::span<const std::uint8_t> bytes) {
  Bytes reply = extended(16, 0x09, no_error);
  if (bytes.size() != 16) {
    reply[6] = function_invalid;
    return reply;
  }
  if ((bytes[6] & 0x01U) != 0) {
    if (stream_.running()) {
      reply[6] = stream_active;
    } else if ((bytes[7] & 0x30U) != 0 && get16(bytes, 8) == 0) {
      reply[6] = watchdog_time;
    } else {
      watchdog_ = {bytes[7], get16(bytes, 8), bytes[10], now_()};
    }
  }
  reply[7] = watchdog_.options;
  put16(reply, 8, watchdog_.timeout_s);
  reply[10] = watchdog_.dio;
  return reply;
}

// Feedback: a list of IOTypes, done in order until one fails.

Bytes EmulatedLabjackU6::feedback(std::span<const std::uint8_t> bytes) {
  Feedback state{bytes.subspan(7), now_(), {}};
  std::uint8_t error = no_error;
  std::uint8_t failed = 0;
  std::uint8_t index = 0;
  while (!state.bytes.empty()) {
    if (state.bytes.size() == 1 && state.bytes[0] == 0) break;  // the padding
    ++index;
    error = io_type(state);
    if (error != no_error) {
      failed = index;
      break;
    }
  }
  std::size_t length = 9 + state.data.size();
  length += length % 2;
  Bytes reply = extended(length, 0x00, error);
  reply[7] = failed;
  reply[8] = bytes[6];
  std::copy(state.data.begin(), state.data.end(), reply.begin() + 9);
  return reply;
}

std::uint8_t EmulatedLabjackU6::io_type(Feedback& feedback) {
  const std::uint8_t type = feedback.bytes[0];
  if (type >= 1 && type <= 3) return analog_input(feedback, type);
  if (type >= 10 && type <= 13) return digital(feedback, type);
  if (type >= 26 && type <= 29) return ports(feedback, type);
  if (type == 5 || type == 6) {
    const auto sent = feedback.take(2);
    if (sent.empty()) return io_type_out_of_step;
    feedback.time_ns += std::int64_t{sent[1]} * (type == 5 ? 64'000 : 16'384'000);
    return no_error;
  }
  if (type == 9) return feedback.take(2).empty() ? io_type_out_of_step : no_error;
  if (type == 34 || type == 35) {
    const auto sent = feedback.take(2);
    if (sent.empty()) return io_type_out_of_step;
    set_dac(type - 34U, static_cast<std::uint16_t>(sent[1] << 8U), feedback.time_ns);
    return no_error;
  }
  if (type == 38 || type == 39) {
    const auto sent = feedback.take(3);
    if (sent.empty()) return io_type_out_of_step;
    set_dac(type - 38U, get16(sent, 1), feedback.time_ns);
    return no_error;
  }
  if (type == 54 || type == 55) {  // counters: nothing is wired to them
    if (feedback.take(2).empty()) return io_type_out_of_step;
    feedback.data.insert(feedback.data.end(), 4, 0);
    return no_error;
  }
  if (type >= 42 && type <= 49) return timer_invalid;  // no timer is configured
  return io_type_invalid;
}

std::uint8_t EmulatedLabjackU6::analog_input(Feedback& feedback, std::uint8_t type) {
  const auto sent = feedback.take(type == 1 ? 3 : 4);
  if (sent.empty()) return io_type_out_of_step;
  if (stream_.running()) return stream_active;
  const int channel = sent[1];
  bool differential = type == 1 && sent[2] == channel + 1;
  int resolution = 0;
  int gain = 0;
  if (type != 1) {
    differential = (sent[3] & 0x80U) != 0;
    resolution = sent[2] & 0x0F;
    gain = sent[2] >> 4;
  }
  if (!analog_channel_exists(channel) || (differential && !may_be_differential(channel))) {
    return analog_pin_invalid;
  }
  if (gain > 3 && gain != 15) return gain_invalid;
  const double input = volts(channel, differential, feedback.time_ns);
  if (gain == 15) {
    gain = 3;
    while (gain > 0 && std::abs(input) > 10.0 * std::pow(0.1, gain)) --gain;
  }
  if (resolution == 0) resolution = options_.pro ? 9 : 8;
  const bool fine = options_.pro && resolution > 8;
  const double counts =
      converted(fine ? calibration_.high_resolution_adc : calibration_.adc, gain, input);
  if (type == 1) {
    const auto rounded = static_cast<std::uint16_t>(std::clamp(std::round(counts), 0.0, 65535.0));
    feedback.data.push_back(static_cast<std::uint8_t>(rounded));
    feedback.data.push_back(static_cast<std::uint8_t>(rounded >> 8U));
    return no_error;
  }
  const auto raw =
      static_cast<std::uint32_t>(std::clamp(std::round(counts * 256.0), 0.0, 16777215.0));
  for (unsigned shift = 0; shift < 24; shift += 8) {
    feedback.data.push_back(static_cast<std::uint8_t>(raw >> shift));
  }
  if (type == 3) {
    feedback.data.push_back(static_cast<std::uint8_t>(resolution | (gain << 4)));
    feedback.data.push_back(0);
  }
  return no_error;
}

std::uint8_t EmulatedLabjackU6::digital(Feedback& feedback, std::uint8_t type) {
  const auto sent = feedback.take(2);
  if (sent.empty()) return io_type_out_of_step;
  const int line = sent[1] & 0x1F;
  if (line >= lines) return digital_pin_invalid;
  const std::uint32_t bit = 1U << static_cast<unsigned>(line);
  const bool high = (sent[1] & 0x80U) != 0;
  switch (type) {
    case 10:
      feedback.data.push_back(level(line) ? 1 : 0);
      break;
    case 11:
      latch_ = high ? latch_ | bit : latch_ & ~bit;
      direction_ |= bit;
      break;
    case 12:
      feedback.data.push_back((direction_ & bit) != 0 ? 1 : 0);
      break;
    default:
      direction_ = high ? direction_ | bit : direction_ & ~bit;
      break;
  }
  update_enable(feedback.time_ns);
  return no_error;
}

std::uint8_t EmulatedLabjackU6::ports(Feedback& feedback, std::uint8_t type) {
  const bool write = type == 27 || type == 29;
  const auto sent = feedback.take(write ? 7 : 1);
  if (sent.empty()) return io_type_out_of_step;
  const auto word = [](std::span<const std::uint8_t> bytes) {
    return (bytes[0] | (std::uint32_t{bytes[1]} << 8U) | (std::uint32_t{bytes[2]} << 16U)) &
           0xFFFFFU;
  };
  std::uint32_t& register_of = type <= 27 ? latch_ : direction_;
  if (write) {
    const std::uint32_t mask = word(sent.subspan(1, 3));
    register_of = (register_of & ~mask) | (word(sent.subspan(4, 3)) & mask);
    if (type == 27) direction_ |= mask;
    update_enable(feedback.time_ns);
    return no_error;
  }
  std::uint32_t now = direction_;
  if (type == 26) {
    now = 0;
    for (int line = 0; line < lines; ++line) {
      if (level(line)) now |= 1U << static_cast<unsigned>(line);
    }
  }
  for (unsigned shift = 0; shift < 24; shift += 8) {
    feedback.data.push_back(static_cast<std::uint8_t>(now >> shift));
  }
  return no_error;
}

// Electronics.

double EmulatedLabjackU6::volts(int input, bool differential, std::int64_t time_ns) {
  if (input == 14) {
    return (298.0 - calibration_.temperature_offset) / calibration_.temperature_slope;
  }
  const auto against_ground = [&](int which) {
    if (which == options_.drive_input) {
      const int dac = options_.drive_dac;
      return u6_dac_volts(calibration_, dac, dac_counts_[static_cast<std::size_t>(dac)]);
    }
    if (which == options_.enable_input) return enabled_.value_or(false) ? 5.0 : 0.0;
    const auto found = inputs_.find(which);
    return found == inputs_.end() ? 0.0 : found->second(wires_, time_ns);
  };
  const double volts = against_ground(input);
  return differential ? volts - against_ground(input + 1) : volts;
}

double EmulatedLabjackU6::converted(const U6ConverterCalibration& adc, int gain, double volts) {
  constexpr double noise_counts[] = {0.4, 0.5, 1.0, 6.0};
  std::normal_distribution<double> normal(0.0, noise_counts[gain]);
  return u6_counts(adc, gain, volts) + options_.noise * normal(noise_);
}

std::uint16_t EmulatedLabjackU6::stream_counts(const U6StreamChannel& channel, std::int64_t time_ns,
                                               double& at_input) {
  at_input = volts(channel.channel, channel.differential, time_ns);
  const double counts = converted(calibration_.adc, channel.gain_index, at_input);
  return static_cast<std::uint16_t>(std::clamp(std::round(counts), 0.0, 65535.0));
}

bool EmulatedLabjackU6::level(int line) const {
  const std::uint32_t bit = 1U << static_cast<unsigned>(line);
  if ((direction_ & bit) != 0) return (latch_ & bit) != 0;
  if (line == options_.amplifier_fault_line) return !wires_.amplifier_fault();
  if (line == options_.emergency_stop_line) return !wires_.emergency_stop();
  if (line == options_.enable_line) return false;  // the contact pulls it down
  return true;                                     // inputs are pulled up
}

void EmulatedLabjackU6::set_dac(std::size_t dac, std::uint16_t counts, std::int64_t time_ns) {
  if (dac_stuck_) return;
  dac_counts_[dac] = counts;
  if (static_cast<int>(dac) == options_.drive_dac) {
    wires_.drive(u6_dac_volts(calibration_, options_.drive_dac, counts), time_ns);
  }
}

void EmulatedLabjackU6::update_enable(std::int64_t time_ns) {
  if (!options_.enable_line) return;
  const bool on = level(*options_.enable_line);
  if (enabled_ == on || contact_stuck_) return;
  enabled_ = on;
  wires_.enable(on, time_ns);
}

// Faults and truth.

void EmulatedLabjackU6::schedule(U6StreamFault fault, std::uint64_t packet) {
  const std::lock_guard hold(lock_);
  stream_.schedule(fault, packet);
}

void EmulatedLabjackU6::chance(U6StreamFault fault, double probability) {
  const std::lock_guard hold(lock_);
  stream_.chance(fault, probability);
}

void EmulatedLabjackU6::schedule(U6ReplyFault fault, std::uint64_t skip,
                                 U6ReplyFaultDetail detail) {
  const std::lock_guard hold(lock_);
  reply_faults_[replies_ + skip] = {fault, detail};
}

void EmulatedLabjackU6::chance(U6ReplyFault fault, double probability, U6ReplyFaultDetail detail) {
  const std::lock_guard hold(lock_);
  reply_chances_[fault] = {probability, detail};
}

void EmulatedLabjackU6::set_silent(bool silent) {
  const std::lock_guard hold(lock_);
  silent_ = silent;
}

std::vector<U6Scan> EmulatedLabjackU6::scans() const {
  const std::lock_guard hold(lock_);
  return stream_.scans();
}

std::uint64_t EmulatedLabjackU6::scans_lost() const {
  const std::lock_guard hold(lock_);
  return stream_.scans_lost();
}

std::uint64_t EmulatedLabjackU6::recoveries() const {
  const std::lock_guard hold(lock_);
  return stream_.recoveries();
}

std::vector<U6FaultyPacket> EmulatedLabjackU6::faulty_packets() const {
  const std::lock_guard hold(lock_);
  return stream_.faulty();
}

std::uint64_t EmulatedLabjackU6::packets() const {
  const std::lock_guard hold(lock_);
  return stream_.packets();
}

std::size_t EmulatedLabjackU6::samples_waiting() const {
  const std::lock_guard hold(lock_);
  return stream_.samples_waiting();
}

bool EmulatedLabjackU6::streaming() const {
  const std::lock_guard hold(lock_);
  return stream_.running();
}

double EmulatedLabjackU6::dac_volts(int dac) const {
  const std::lock_guard hold(lock_);
  return u6_dac_volts(calibration_, dac, dac_counts_[static_cast<std::size_t>(dac)]);
}

bool EmulatedLabjackU6::line_is_output(int line) const {
  const std::lock_guard hold(lock_);
  return (direction_ >> static_cast<unsigned>(line) & 1U) != 0;
}

bool EmulatedLabjackU6::line_is_high(int line) const {
  const std::lock_guard hold(lock_);
  return level(line);
}

std::uint64_t EmulatedLabjackU6::watchdog_trips() const {
  const std::lock_guard hold(lock_);
  return trips_;
}

bool EmulatedLabjackU6::watchdog_armed() const {
  const std::lock_guard hold(lock_);
  return watchdog_.armed();
}

std::uint64_t EmulatedLabjackU6::resets() const {
  const std::lock_guard hold(lock_);
  return resets_;
}

bool EmulatedLabjackU6::answers_taken() const {
  const std::lock_guard hold(lock_);
  return answers_.empty();
}

std::uint64_t EmulatedLabjackU6::commands() const {
  const std::lock_guard hold(lock_);
  return commands_;
}

}  // namespace stickslip::emulated
