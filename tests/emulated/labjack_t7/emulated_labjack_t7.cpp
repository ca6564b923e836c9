// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/labjack_t7/emulated_labjack_t7.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <stdexcept>

namespace stickslip::emulated {

namespace {

constexpr std::uint16_t marker = 0xFFFF;
constexpr std::size_t small_buffer_samples = 500;
constexpr std::size_t most_unsent_bytes = 1U << 17U;

std::uint16_t word(const std::vector<std::uint8_t>& bytes, std::size_t at) {
  return static_cast<std::uint16_t>(bytes.at(at) * 256U + bytes.at(at + 1));
}

void append(std::vector<std::uint8_t>& bytes, unsigned value) {
  bytes.push_back(static_cast<std::uint8_t>(value / 256U % 256U));
  bytes.push_back(static_cast<std::uint8_t>(value % 256U));
}

std::vector<std::uint8_t> header(unsigned transaction, unsigned length, unsigned function) {
  std::vector<std::uint8_t> out;
  append(out, transaction);
  append(out, 0);
  append(out, length);
  out.push_back(1);
  out.push_back(static_cast<std::uint8_t>(function));
  return out;
}

/// Index of a range: 0: 10 V, to 3: 0.01 V.
int range_index(float volts) {
  return volts == 10.0F ? 0 : volts == 1.0F ? 1 : volts == 0.1F ? 2 : 3;
}

}  // namespace

EmulatedLabjackT7::EmulatedLabjackT7(Wires& wires, Now now, const T7Options& options)
    : wires_(wires),
      now_(std::move(now)),
      options_(options),
      constants_(T7Constants::of(options.seed)) {
  registers_.set_real(60000, options.product);
  registers_.set_real(60004, options.firmware);
  registers_.set_number(60028, options.serial);
  cleared_ns_ = now_();
  listen();
  thread_ = std::thread([this] { run(); });
}

EmulatedLabjackT7::~EmulatedLabjackT7() {
  ending_ = true;
  thread_.join();
  close_all();
}

void EmulatedLabjackT7::listen() {
  for (int i = 0; i < 2; ++i) {
    const int file = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const int on = 1;
    ::setsockopt(file, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(ports_[i]));
    socklen_t size = sizeof address;
    if (::bind(file, reinterpret_cast<sockaddr*>(&address), size) != 0 || ::listen(file, 4) != 0 ||
        ::getsockname(file, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
      throw std::runtime_error("the loopback interface cannot be used");
    }
    ports_[i] = ntohs(address.sin_port);
    listeners_[i] = file;
  }
}

void EmulatedLabjackT7::close_all() {
  for (int& listener : listeners_) {
    if (listener < 0) continue;
    ::shutdown(listener, SHUT_RDWR);  // the other thread may hold it in poll
    ::close(listener);
    listener = -1;
  }
  close_clients();
}

void EmulatedLabjackT7::close_clients() {
  for (const Client& client : clients_) ::close(client.file);
  clients_.clear();
}

void EmulatedLabjackT7::hang_up() {
  const std::lock_guard lock(mutex_);
  close_clients();
}

void EmulatedLabjackT7::unplug() {
  const std::lock_guard lock(mutex_);
  close_all();
}

void EmulatedLabjackT7::plug() {
  const std::lock_guard lock(mutex_);
  if (listeners_[0] < 0) listen();
}

void EmulatedLabjackT7::become(std::uint32_t serial) {
  const std::lock_guard lock(mutex_);
  registers_.set_number(60028, serial);
}

void EmulatedLabjackT7::wire(int input, const Sensor& sensor) {
  const std::lock_guard lock(mutex_);
  sensors_[input] = sensor;
}

void EmulatedLabjackT7::fault_replies(T7ReplyFault fault, int count) {
  const std::lock_guard lock(mutex_);
  reply_fault_ = fault;
  faulty_replies_ = count;
}

void EmulatedLabjackT7::fault_next_packet(T7StreamFault fault) {
  const std::lock_guard lock(mutex_);
  stream_fault_ = fault;
}

void EmulatedLabjackT7::refuse_address(int address, std::uint16_t error) {
  const std::lock_guard lock(mutex_);
  refused_.erase(address);
  if (error != 0) refused_[address] = error;
}

void EmulatedLabjackT7::overflow_by(std::uint64_t scans) {
  const std::lock_guard lock(mutex_);
  hold_until_skipped_ = scans;
}

void EmulatedLabjackT7::stop_scanning(bool stopped) {
  const std::lock_guard lock(mutex_);
  stopped_ = stopped;
}

void EmulatedLabjackT7::misreport_rate(double factor) {
  const std::lock_guard lock(mutex_);
  misreport_ = factor;
}

void EmulatedLabjackT7::set_constant(int gain, int place, float value) {
  const std::lock_guard lock(mutex_);
  constants_.gain[static_cast<std::size_t>(gain)][static_cast<std::size_t>(place)] = value;
}

std::vector<EmulatedLabjackT7::Write> EmulatedLabjackT7::writes() const {
  const std::lock_guard lock(mutex_);
  return writes_;
}
std::uint32_t EmulatedLabjackT7::number(int address) const {
  const std::lock_guard lock(mutex_);
  return registers_.number(address);
}
float EmulatedLabjackT7::real(int address) const {
  const std::lock_guard lock(mutex_);
  return registers_.real(address);
}
bool EmulatedLabjackT7::streaming() const {
  const std::lock_guard lock(mutex_);
  return streaming_;
}
std::uint64_t EmulatedLabjackT7::watchdog_trips() const {
  const std::lock_guard lock(mutex_);
  return trips_;
}
std::uint64_t EmulatedLabjackT7::scans_skipped() const {
  const std::lock_guard lock(mutex_);
  return all_skipped_;
}
std::uint64_t EmulatedLabjackT7::overflows() const {
  const std::lock_guard lock(mutex_);
  return overflows_;
}
std::uint64_t EmulatedLabjackT7::requests() const {
  const std::lock_guard lock(mutex_);
  return requests_;
}

void EmulatedLabjackT7::run() {
  while (!ending_) {
    std::vector<pollfd> files;
    {
      const std::lock_guard lock(mutex_);
      for (const int listener : listeners_) files.push_back({listener, POLLIN, 0});
      for (const Client& client : clients_) files.push_back({client.file, POLLIN, 0});
    }
    ::poll(files.data(), files.size(), 1);
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < 2; ++i) {
      if (files[i].revents != 0 && listeners_[i] == files[i].fd) accept_one(listeners_[i], i == 1);
    }
    for (auto client = clients_.begin(); client != clients_.end();) {
      const bool open = receive(*client);
      if (!open) ::close(client->file);
      client = open ? std::next(client) : clients_.erase(client);
    }
    advance();
    watch();
    flush();
  }
}

void EmulatedLabjackT7::accept_one(int listener, bool stream) {
  const int file = ::accept4(listener, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (file < 0) return;
  const int on = 1;
  ::setsockopt(file, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  clients_.push_back({file, stream, {}, {}});
}

/// False: the connection has ended.
bool EmulatedLabjackT7::receive(Client& client) {
  std::uint8_t bytes[2048];
  const ssize_t got = ::recv(client.file, bytes, sizeof bytes, MSG_DONTWAIT);
  if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) return false;
  if (got > 0) client.in.insert(client.in.end(), bytes, bytes + got);
  while (client.in.size() >= 6) {
    const std::size_t size = 6U + word(client.in, 4);
    if (client.in.size() < size) break;
    const auto end = client.in.begin() + static_cast<std::ptrdiff_t>(size);
    answer(client, Bytes(client.in.begin(), end));
    client.in.erase(client.in.begin(), end);
  }
  return true;
}

void EmulatedLabjackT7::answer(Client& client, const Bytes& message) {
  ++requests_;
  if (registers_.number(61610) == 0) cleared_ns_ = now_();  // not strict: everything counts
  T7ReplyFault fault = T7ReplyFault::none;
  if (faulty_replies_ != 0) {
    fault = reply_fault_;
    if (faulty_replies_ > 0) --faulty_replies_;
  }
  Bytes data;
  std::uint8_t exception = 0;
  bool done = execute(message, data, exception);
  if (fault == T7ReplyFault::missing) return;
  if (fault == T7ReplyFault::exception) {
    done = false;
    exception = 4;
  }
  if (fault == T7ReplyFault::wrong_length) data.push_back(0);
  const unsigned shift = fault == T7ReplyFault::wrong_transaction ? 1000 : 0;
  Bytes reply = header(word(message, 0) + shift,
                       static_cast<unsigned>(2 + (done ? data.size() : 1)), done ? 76 : 0xCC);
  if (done) {
    reply.insert(reply.end(), data.begin(), data.end());
  } else {
    reply.push_back(exception);
  }
  client.out.insert(client.out.end(), reply.begin(), reply.end());
}

/// The accesses of a request, in order, up to the first that fails.
bool EmulatedLabjackT7::execute(const Bytes& message, Bytes& data, std::uint8_t& exception) {
  exception = 1;
  if (message.size() < 8 || message[7] != 76) return false;
  for (std::size_t at = 8; at + 4 <= message.size();) {
    const bool writes = message[at] == 1;
    const int address = word(message, at + 1);
    const std::size_t bytes = 2U * message[at + 3];
    at += 4;
    exception = 2;
    if (!registers_.has(address)) return fail(1202) == 0;
    exception = 4;
    if (const auto refused = refused_.find(address); refused != refused_.end()) {
      return fail(refused->second) == 0;
    }
    if (!writes) {
      const Bytes value = read(address, static_cast<int>(bytes / 2));
      data.insert(data.end(), value.begin(), value.end());
      continue;
    }
    if (at + bytes > message.size()) return fail(1203) == 0;
    const auto begin = message.begin() + static_cast<std::ptrdiff_t>(at);
    if (!write(address, Bytes(begin, begin + static_cast<std::ptrdiff_t>(bytes)))) return false;
    at += bytes;
  }
  return true;
}

std::uint16_t EmulatedLabjackT7::fail(std::uint16_t error) {
  registers_.set_word(55000, error);
  return error;
}

bool EmulatedLabjackT7::may_write(int address) {
  const bool stream_setting = (address >= 4002 && address < 4990) || (address / 1000 == 40);
  if (stream_setting && streaming_) return fail(2605) == 0;
  const bool watchdog_setting = address > 61600 && address < 61660 && address != 61614;
  if (watchdog_setting && registers_.number(61600) != 0) return fail(2671) == 0;
  return true;
}

bool EmulatedLabjackT7::write(int address, const Bytes& value) {
  if (!may_write(address)) return false;
  const std::uint32_t number =
      value.size() == 2 ? word(value, 0) : word(value, 0) * 65536U + word(value, 2);
  writes_.push_back({address, number});
  if (value.size() == 2) {
    registers_.set_word(address, static_cast<std::uint16_t>(number));
  } else {
    registers_.set_number(address, number);
  }
  if (address >= 2000 && address < 2023) {
    const std::uint32_t bit = 1U << static_cast<unsigned>(address - 2000);
    outputs_ |= bit;
    states_ = number != 0 ? states_ | bit : states_ & ~bit;
  }
  const bool clears = address == 61614 && number == registers_.number(61612);
  if (clears || address == 61600) cleared_ns_ = now_();
  if (address < 3000) show_outputs();
  return address != 4990 || start_stream(number != 0);
}

bool EmulatedLabjackT7::start_stream(bool enable) {
  if (!enable) {
    if (!streaming_) return fail(2620) == 0;
    streaming_ = false;
    return true;
  }
  const double rate_hz = static_cast<double>(registers_.real(4002));
  const std::uint32_t channels = registers_.number(4004);
  if (channels == 0) return fail(2600) == 0;
  if (registers_.number(4016) != 1 || registers_.number(4018) != 0) return fail(2612) == 0;
  if (registers_.number(4006) == 0 || registers_.number(4006) > 512) return fail(2618) == 0;
  if (rate_hz * channels > 100000.0) return fail(2608) == 0;
  std::int64_t step_ns = 100;
  while (std::round(1e9 / rate_hz / static_cast<double>(step_ns)) > 65536.0) step_ns *= 10;
  const double steps = std::round(1e9 / rate_hz / static_cast<double>(step_ns));
  interval_ns_ = static_cast<std::int64_t>(steps) * step_ns;
  registers_.set_real(4002,
                      static_cast<float>(misreport_ * 1e9 / static_cast<double>(interval_ns_)));
  streaming_ = true;
  recovering_ = false;
  report_.reset();
  buffer_.clear();
  next_scan_ = 0;
  next_packet_ = 0;
  started_ns_ = now_();
  return true;
}

EmulatedLabjackT7::Bytes EmulatedLabjackT7::read(int address, int registers) {
  if (address >= 2000 && address < 2023) outputs_ &= ~(1U << static_cast<unsigned>(address - 2000));
  if (address == 2800) registers_.set_number(2800, levels());
  Bytes out;
  if (address == 61812) {
    const std::uint32_t first = (registers_.number(61810) - 0x3C4000U) / 4U;
    for (std::uint32_t i = first; i < first + static_cast<std::uint32_t>(registers) / 2U; ++i) {
      const float value = i < 16 ? constants_.gain[i / 4][i % 4] : 0.0F;
      append(out, std::bit_cast<std::uint32_t>(value) / 65536U);
      append(out, std::bit_cast<std::uint32_t>(value) % 65536U);
    }
    return out;
  }
  for (int i = 0; i < registers; ++i) append(out, registers_.word(address + i));
  return out;
}

/// Inputs are pulled up; the wired ones are high unless active.
std::uint32_t EmulatedLabjackT7::levels() const {
  std::uint32_t inputs = 0x7FFFFF;
  const auto pull = [&inputs](int line, bool low) {
    if (line >= 0 && low) inputs &= ~(1U << static_cast<unsigned>(line));
  };
  pull(options_.amplifier_fault_line, wires_.amplifier_fault());
  pull(options_.emergency_stop_line, wires_.emergency_stop());
  return (inputs & ~outputs_) | (states_ & outputs_);
}

void EmulatedLabjackT7::show_outputs() {
  const std::int64_t now_ns = now_();
  wires_.drive(static_cast<double>(registers_.real(1000 + 2 * options_.dac)), now_ns);
  if (options_.enable_line < 0) return;
  const std::uint32_t bit = 1U << static_cast<unsigned>(options_.enable_line);
  wires_.enable((outputs_ & states_ & bit) != 0, now_ns);
}

void EmulatedLabjackT7::watch() {
  if (registers_.number(61600) == 0) return;
  const std::int64_t timeout_ns = std::int64_t{registers_.number(61604)} * 1'000'000'000;
  if (now_() - cleared_ns_ < timeout_ns) return;
  cleared_ns_ = now_();
  ++trips_;
  if (registers_.number(61630) != 0) {
    const std::uint32_t affected = ~registers_.number(61636);
    states_ = (states_ & ~affected) | (registers_.number(61632) & affected);
    outputs_ = (outputs_ & ~affected) | (registers_.number(61634) & affected);
  }
  if (registers_.number(61640) != 0) registers_.set_real(1000, registers_.real(61642));
  if (registers_.number(61650) != 0) registers_.set_real(1002, registers_.real(61652));
  show_outputs();
}

/// The scans that are due, by the board's own counter.
void EmulatedLabjackT7::advance() {
  if (!streaming_) return;
  const auto due = static_cast<std::uint64_t>((now_() - started_ns_) / interval_ns_);
  const std::size_t channels = registers_.number(4004);
  const std::uint32_t bytes = registers_.number(4012) == 0 ? 4096 : registers_.number(4012);
  for (; next_scan_ < due && !stopped_; ++next_scan_) {
    const bool held = hold_until_skipped_ > 0;
    const std::size_t capacity = held ? small_buffer_samples : bytes / 2;
    if (!recovering_ && buffer_.size() + channels > capacity) {
      recovering_ = true;
      skipped_ = 0;
      ++overflows_;
    }
    if (recovering_) {
      ++skipped_;
      ++all_skipped_;
    } else {
      scan(next_scan_);
    }
    if (recovering_ && skipped_ >= hold_until_skipped_) hold_until_skipped_ = 0;
    if (hold_until_skipped_ == 0) send_packets();
  }
  if (hold_until_skipped_ == 0) send_packets();
}

void EmulatedLabjackT7::scan(std::uint64_t index) {
  const auto time_ns = static_cast<std::int64_t>(index) * interval_ns_;
  const auto volts = [this, time_ns](int input) {
    const auto found = sensors_.find(input);
    return found == sensors_.end() ? 0.0 : found->second(wires_, time_ns);
  };
  for (std::uint32_t i = 0; i < registers_.number(4004); ++i) {
    const int input = static_cast<int>(registers_.number(4100 + 2 * static_cast<int>(i))) / 2;
    const int negative = registers_.word(41000 + input);
    const double difference = volts(input) - (negative == 199 ? 0.0 : volts(negative));
    const int range = range_index(registers_.real(40000 + 2 * input));
    buffer_.push_back(constants_.counts(range, difference));
  }
}

void EmulatedLabjackT7::send_packets() {
  for (Client& client : clients_) {
    if (!client.stream) continue;
    const std::size_t samples = registers_.number(4006);
    while (streaming_ && buffer_.size() >= samples && client.out.size() < most_unsent_bytes) {
      packet(client);
    }
    if (!recovering_ || buffer_.size() >= samples) continue;
    recovering_ = false;
    buffer_.insert(buffer_.end(), registers_.number(4004), marker);
    report_ = static_cast<std::uint16_t>(std::min<std::uint64_t>(skipped_, 65535));
  }
}

void EmulatedLabjackT7::packet(Client& client) {
  const std::size_t samples = registers_.number(4006);
  const T7StreamFault fault = std::exchange(stream_fault_, T7StreamFault::none);
  unsigned status = recovering_ ? 2940 : report_ ? 2941 : 0;
  if (fault == T7StreamFault::overlap) status = 2942;
  const unsigned shift = fault == T7StreamFault::wrong_transaction ? 5000 : 0;
  const auto length = static_cast<unsigned>(10 + 2 * samples);
  Bytes out = header(next_packet_++ + shift, length, fault == T7StreamFault::no_packet ? 3 : 76);
  out.push_back(16);
  out.push_back(0);
  append(out, static_cast<unsigned>(2 * (buffer_.size() - samples)));
  append(out, status);
  append(out, report_.value_or(0));
  report_.reset();
  for (std::size_t i = 0; i < samples; ++i) {
    append(out, buffer_.front());
    buffer_.pop_front();
  }
  if (fault == T7StreamFault::missing) return;
  if (fault == T7StreamFault::cut) out.resize(out.size() / 2);
  client.out.insert(client.out.end(), out.begin(), out.end());
  if (fault != T7StreamFault::cut) return;
  flush();
  ::shutdown(client.file, SHUT_RDWR);
  streaming_ = false;
}

void EmulatedLabjackT7::flush() {
  for (Client& client : clients_) {
    if (client.out.empty()) continue;
    const ssize_t sent =
        ::send(client.file, client.out.data(), client.out.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (sent > 0) client.out.erase(client.out.begin(), client.out.begin() + sent);
  }
}

}  // namespace stickslip::emulated
