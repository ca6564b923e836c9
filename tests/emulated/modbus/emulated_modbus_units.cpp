// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/modbus/emulated_modbus_units.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <tuple>
#include <utility>

namespace stickslip::emulated {

namespace {

constexpr std::uint8_t illegal_function = 1;
constexpr std::uint8_t illegal_address = 2;
constexpr std::uint8_t illegal_value = 3;
constexpr std::uint8_t busy = 6;
constexpr std::int64_t piece_ns = 3'000'000;

std::size_t size_of(Kind kind) {
  switch (kind) {
    case Kind::bit:
    case Kind::u16:
    case Kind::i16:
    case Kind::bcd16:
      return 2;
    case Kind::i64:
    case Kind::f64:
      return 8;
    default:
      return 4;
  }
}

template <typename Number>
Bytes big_endian(Number number) {
  Bytes bytes(sizeof number);
  std::memcpy(bytes.data(), &number, sizeof number);
  std::reverse(bytes.begin(), bytes.end());  // the host is little-endian
  return bytes;
}

Bytes decimal(double number, std::size_t size) {
  Bytes bytes(size);
  auto left = static_cast<std::uint64_t>(number);
  for (std::size_t i = size; i-- > 0; left /= 100) {
    bytes[i] = static_cast<std::uint8_t>((left / 10 % 10) * 16 + left % 10);
  }
  return bytes;
}

Bytes plain(Kind kind, double number) {
  switch (kind) {
    case Kind::bit:
      return {0, static_cast<std::uint8_t>(number != 0.0)};
    case Kind::u16:
      return big_endian(static_cast<std::uint16_t>(std::llround(number)));
    case Kind::i16:
      return big_endian(static_cast<std::int16_t>(std::llround(number)));
    case Kind::u32:
      return big_endian(static_cast<std::uint32_t>(std::llround(number)));
    case Kind::i32:
      return big_endian(static_cast<std::int32_t>(std::llround(number)));
    case Kind::i64:
      return big_endian(static_cast<std::int64_t>(std::llround(number)));
    case Kind::f32:
      return big_endian(static_cast<float>(number));
    case Kind::f64:
      return big_endian(number);
    case Kind::bcd16:
      return decimal(number, 2);
    case Kind::bcd32:
      break;
  }
  return decimal(number, 4);
}

int word(const Bytes& bytes, std::size_t at) { return bytes.at(at) * 256 + bytes.at(at + 1); }

Bytes refusal(std::uint8_t code) { return {0x80, code}; }

/// Length of a request, from the unit to the end of its data, from its first bytes `head`; 0:
/// invalid.
std::size_t length_of(const Bytes& head) {
  if (head.size() < 2) return 2;
  switch (head[1]) {
    case 1:
    case 2:
    case 3:
    case 4:
    case 5:
    case 6:
      return 6;
    case 15:
    case 16:
      return head.size() < 7 ? 7 : 7U + head[6];
    default:
      return 0;
  }
}

}  // namespace

Bytes bytes_of(Kind kind, const std::string& order, double number) {
  Bytes bytes = plain(kind, number);
  if (kind == Kind::bit) return bytes;
  if (order == "CDAB" || order == "DCBA") {
    for (std::size_t i = 0, j = bytes.size() - 2; i < j; i += 2, j -= 2) {
      std::swap(bytes[i], bytes[j]);
      std::swap(bytes[i + 1], bytes[j + 1]);
    }
  }
  if (order == "BADC" || order == "DCBA") {
    for (std::size_t i = 0; i < bytes.size(); i += 2) std::swap(bytes[i], bytes[i + 1]);
  }
  return bytes;
}

std::uint16_t checksum_of(const Bytes& message) {
  unsigned crc = 0xFFFF;
  for (const std::uint8_t byte : message) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1U) != 0 ? (crc >> 1U) ^ 0xA001U : crc >> 1U;
  }
  return static_cast<std::uint16_t>(crc);
}

Parameter measured(Parameter parameter, Sensor sensor, Wires& wires, double resolution) {
  parameter.number = [sensor, &wires, resolution](std::int64_t time_ns) {
    return sensor(wires, time_ns) / resolution;
  };
  return parameter;
}

UnitRules orbit_rules() {
  UnitRules rules;
  rules.functions = {3, 4, 6, 16};
  rules.whole_parameters_only = true;
  rules.gaps_are_readable = false;
  rules.float_mirror = 8000;
  return rules;
}

UnitRules dsc_rules() {
  UnitRules rules;
  rules.functions = {3, 16};
  rules.whole_parameters_only = true;
  rules.pairs_only = true;
  rules.gaps_are_readable = false;
  return rules;
}

EmulatedModbusUnits::EmulatedModbusUnits(Now now, std::filesystem::path folder, std::uint32_t seed)
    : now_(std::move(now)), folder_(std::move(folder)), random_(seed) {
  std::filesystem::create_directories(folder_);
  open_terminal();
  listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  if (::bind(listener_, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
      ::listen(listener_, 8) != 0 ||
      ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    throw std::runtime_error("no TCP port on the loopback");
  }
  port_ = ntohs(address.sin_port);
}

EmulatedModbusUnits::~EmulatedModbusUnits() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
  for (Line& line : lines_) close_line(line);
  if (slave_ >= 0) ::close(slave_);
  ::close(listener_);
  std::filesystem::remove(folder_ / "line");
}

void EmulatedModbusUnits::open_terminal() {
  const int master = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (master < 0 || ::grantpt(master) != 0 || ::unlockpt(master) != 0) {
    throw std::runtime_error("no pseudo-terminal");
  }
  const char* name = ::ptsname(master);
  // Held open, so that the line persists while the driver closes and reopens it.
  slave_ = ::open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
  termios raw{};
  ::tcgetattr(slave_, &raw);
  ::cfmakeraw(&raw);
  ::tcsetattr(slave_, TCSANOW, &raw);
  std::filesystem::remove(folder_ / "line");
  std::filesystem::create_symlink(name, folder_ / "line");
  lines_.push_front({master, false, {}});
}

void EmulatedModbusUnits::add(int unit, UnitRules rules, std::vector<Parameter> parameters) {
  units_[unit].rules = std::move(rules);
  units_[unit].parameters = std::move(parameters);
}

void EmulatedModbusUnits::start() {
  thread_ = std::thread([this] { run(); });
}

void EmulatedModbusUnits::weather(int unit, Weather weather) {
  const std::lock_guard lock(mutex_);
  units_[unit].weather = std::move(weather);
}

void EmulatedModbusUnits::next(int unit, LineFault fault, std::int64_t late_ns) {
  const std::lock_guard lock(mutex_);
  units_[unit].next.emplace_back(fault, late_ns);
}

void EmulatedModbusUnits::dead(int unit, bool is_dead) {
  const std::lock_guard lock(mutex_);
  units_[unit].dead = is_dead;
}

void EmulatedModbusUnits::refuse(int unit, std::uint8_t exception) {
  const std::lock_guard lock(mutex_);
  units_[unit].refusal = exception;
}

void EmulatedModbusUnits::unplug() {
  const std::lock_guard lock(mutex_);
  for (Line& line : lines_) {
    if (!line.tcp) close_line(line);
  }
  if (slave_ >= 0) ::close(slave_);
  slave_ = -1;
  std::filesystem::remove(folder_ / "line");
}

void EmulatedModbusUnits::plug_in() {
  const std::lock_guard lock(mutex_);
  open_terminal();
}

void EmulatedModbusUnits::close_connections() {
  const std::lock_guard lock(mutex_);
  for (Line& line : lines_) {
    if (line.tcp) close_line(line);
  }
}

std::uint64_t EmulatedModbusUnits::requests(int unit) const {
  const std::lock_guard lock(mutex_);
  return units_.at(unit).requests;
}

std::uint64_t EmulatedModbusUnits::writes(int unit) const {
  const std::lock_guard lock(mutex_);
  return units_.at(unit).writes;
}

std::uint64_t EmulatedModbusUnits::faults() const {
  const std::lock_guard lock(mutex_);
  return faults_;
}

std::uint64_t EmulatedModbusUnits::nonsense() const {
  const std::lock_guard lock(mutex_);
  return nonsense_;
}

double EmulatedModbusUnits::written(int unit, Table table, int address) const {
  const std::lock_guard lock(mutex_);
  const auto& store = units_.at(unit).store;
  const auto entry = store.find({static_cast<int>(table), address});
  return entry == store.end() ? 0.0 : word(entry->second, 0);
}

void EmulatedModbusUnits::run() {
  while (!stopping_) {
    std::vector<pollfd> waited;
    int wait_ms = 20;
    {
      const std::lock_guard lock(mutex_);
      send_due();
      if (!due_.empty()) wait_ms = 1;
      waited.push_back({listener_, POLLIN, 0});
      for (const Line& line : lines_) {
        if (line.file >= 0) waited.push_back({line.file, POLLIN, 0});
      }
    }
    // Short: late replies and new lines are handled when it returns.
    ::poll(waited.data(), waited.size(), wait_ms);
    const std::lock_guard lock(mutex_);
    if ((waited[0].revents & POLLIN) != 0) accept_connection();
    serve_lines();
  }
}

void EmulatedModbusUnits::serve_lines() {
  for (Line& line : lines_) {
    pollfd waited{line.file, POLLIN, 0};
    if (line.file < 0 || ::poll(&waited, 1, 0) <= 0) continue;
    std::uint8_t buffer[512];
    const ssize_t size = ::read(line.file, buffer, sizeof buffer);
    if (size <= 0) {
      close_line(line);
      continue;
    }
    line.received.insert(line.received.end(), buffer, buffer + size);
    while (line.file >= 0 && take(line)) {
    }
  }
  std::erase_if(lines_, [](const Line& line) { return line.file < 0; });
}

void EmulatedModbusUnits::accept_connection() {
  const int file = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
  if (file < 0) return;
  const int on = 1;
  ::setsockopt(file, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  lines_.push_back({file, true, {}});
}

void EmulatedModbusUnits::close_line(Line& line) {
  if (line.file < 0) return;
  std::erase_if(due_, [&line](const Due& due) { return due.file == line.file; });
  ::close(line.file);
  line.file = -1;
}

bool EmulatedModbusUnits::take(Line& line) { return line.tcp ? take_tcp(line) : take_serial(line); }

bool EmulatedModbusUnits::take_serial(Line& line) {
  const std::size_t length = length_of(line.received);
  if (length != 0 && line.received.size() < length + 2) return false;
  Bytes message(line.received.begin(), line.received.begin() + static_cast<std::ptrdiff_t>(length));
  const bool valid = length != 0 && checksum_of(message) ==
                                        line.received[length] + 256 * line.received[length + 1];
  if (!valid) {
    ++nonsense_;
    line.received.clear();
    return false;
  }
  line.received.erase(line.received.begin(),
                      line.received.begin() + static_cast<std::ptrdiff_t>(length + 2));
  return handle(line, 0, message);
}

bool EmulatedModbusUnits::take_tcp(Line& line) {
  if (line.received.size() < 6) return false;
  const auto length = static_cast<std::size_t>(word(line.received, 4));
  if (word(line.received, 2) != 0 || length < 2 || length > 254) {
    ++nonsense_;
    close_line(line);
    return false;
  }
  if (line.received.size() < 6 + length) return false;
  const int transaction = word(line.received, 0);
  const auto end = line.received.begin() + static_cast<std::ptrdiff_t>(6 + length);
  const Bytes message(line.received.begin() + 6, end);
  line.received.erase(line.received.begin(), end);
  if (length_of(message) != message.size()) {
    ++nonsense_;
    return true;
  }
  return handle(line, transaction, message);
}

/// False if the line is closed.
bool EmulatedModbusUnits::handle(Line& line, int transaction, const Bytes& message) {
  const auto entry = units_.find(message[0]);
  if (entry == units_.end() || entry->second.dead) return true;
  Unit& unit = entry->second;
  ++unit.requests;
  Bytes reply = unit.refusal != 0 ? refusal(unit.refusal) : answer(unit, message);
  if (reply[0] == 0x80) reply[0] = static_cast<std::uint8_t>(message[1] | 0x80);
  reply.insert(reply.begin(), message[0]);
  return deliver(line, transaction, std::move(reply), unit);
}

/// Beginning with the function.
Bytes EmulatedModbusUnits::answer(Unit& unit, const Bytes& message) {
  const int function = message[1];
  const auto& allowed = unit.rules.functions;
  if (std::find(allowed.begin(), allowed.end(), function) == allowed.end()) {
    return refusal(illegal_function);
  }
  const int address = word(message, 2);
  const int count = word(message, 4);
  if (function <= 2) {
    if (count < 1 || count > 2000) return refusal(illegal_value);
    return read_bits(unit, static_cast<Table>(function), address, count);
  }
  if (function <= 4) {
    if (count < 1 || count > 125) return refusal(illegal_value);
    if (unit.rules.pairs_only && count != 2) return refusal(illegal_value);
    return read_registers(unit, static_cast<Table>(function), address, count);
  }
  ++unit.writes;
  return write(unit, message);
}

Bytes EmulatedModbusUnits::content(Unit& unit, const Parameter& parameter) {
  if (parameter.number) return bytes_of(parameter.kind, parameter.order, parameter.number(now_()));
  const auto entry = unit.store.find({static_cast<int>(parameter.table), parameter.address});
  return entry == unit.store.end() ? Bytes(size_of(parameter.kind)) : entry->second;
}

Bytes EmulatedModbusUnits::read_bits(Unit& unit, Table table, int address, int count) {
  Bytes reply{static_cast<std::uint8_t>(table), static_cast<std::uint8_t>((count + 7) / 8)};
  reply.resize(2 + static_cast<std::size_t>(count + 7) / 8);
  for (int i = 0; i < count; ++i) {
    bool found = unit.rules.gaps_are_readable;
    for (const Parameter& parameter : unit.parameters) {
      if (parameter.table != table || parameter.address != address + i) continue;
      found = true;
      const std::uint8_t bit = content(unit, parameter)[1] != 0 ? 1 : 0;
      reply[2 + static_cast<std::size_t>(i / 8)] |= static_cast<std::uint8_t>(bit << (i % 8));
    }
    if (!found) return refusal(illegal_address);
  }
  return reply;
}

Bytes EmulatedModbusUnits::read_registers(Unit& unit, Table table, int address, int count) {
  Bytes words(2 * static_cast<std::size_t>(count));
  std::vector<bool> covered(static_cast<std::size_t>(count), unit.rules.gaps_are_readable);
  for (const Parameter& parameter : unit.parameters) {
    if (parameter.table != table) continue;
    for (const int mirror : {0, unit.rules.float_mirror}) {
      if (mirror != 0 && !parameter.number) continue;
      const Bytes bytes = mirror == 0 ? content(unit, parameter)
                                      : bytes_of(Kind::f32, "ABCD", parameter.number(now_()));
      const int first = parameter.address + mirror - address;
      const int end = first + static_cast<int>(bytes.size() / 2);
      if (end <= 0 || first >= count) continue;
      if (unit.rules.whole_parameters_only && (first < 0 || end > count)) {
        return refusal(illegal_address);
      }
      for (int i = std::max(first, 0); i < std::min(end, count); ++i) {
        const auto to = static_cast<std::size_t>(i);
        const auto from = static_cast<std::size_t>(i - first);
        words[2 * to] = bytes[2 * from];
        words[2 * to + 1] = bytes[2 * from + 1];
        covered[to] = true;
      }
      if (unit.rules.float_mirror == 0) break;
    }
  }
  if (std::find(covered.begin(), covered.end(), false) != covered.end()) {
    return refusal(illegal_address);
  }
  Bytes reply{static_cast<std::uint8_t>(table), static_cast<std::uint8_t>(words.size())};
  reply.insert(reply.end(), words.begin(), words.end());
  return reply;
}

Bytes EmulatedModbusUnits::write(Unit& unit, const Bytes& message) {
  const int function = message[1];
  const bool bits = function == 5 || function == 15;
  Bytes value;
  if (function == 5) value = {0, static_cast<std::uint8_t>(message[4] != 0 ? 1 : 0)};
  if (function == 15) value = {0, static_cast<std::uint8_t>(message[7] & 1U)};
  if (function == 6) value.assign(message.begin() + 4, message.end());
  if (function == 16) value.assign(message.begin() + 7, message.end());
  for (const Parameter& parameter : unit.parameters) {
    const bool fits = parameter.address == word(message, 2) && !parameter.number &&
                      parameter.table == (bits ? Table::coils : Table::holding) &&
                      size_of(parameter.kind) == value.size();
    if (!fits) continue;
    if (!parameter.locked)
      unit.store[{static_cast<int>(parameter.table), parameter.address}] = value;
    return {message.begin() + 1, message.begin() + 6};
  }
  return refusal(illegal_address);
}

LineFault EmulatedModbusUnits::drawn(Unit& unit, std::int64_t& late_ns) {
  late_ns = unit.weather.late_ns;
  LineFault fault = LineFault::none;
  if (!unit.next.empty()) {
    std::tie(fault, late_ns) = unit.next.front();
    unit.next.pop_front();
  } else if (!unit.weather.faults.empty() &&
             std::uniform_real_distribution<>(0.0, 1.0)(random_) < unit.weather.probability) {
    fault = unit.weather.faults[random_() % unit.weather.faults.size()];
  }
  if (fault != LineFault::none) ++faults_;
  return fault;
}

bool EmulatedModbusUnits::deliver(Line& line, int transaction, Bytes message, Unit& unit) {
  std::int64_t late_ns = 0;
  const LineFault fault = drawn(unit, late_ns);
  if (fault == LineFault::closed && line.tcp) {
    close_line(line);
    return false;
  }
  if (fault == LineFault::silent || fault == LineFault::closed) return true;
  if (fault == LineFault::wrong_unit) {
    message[0] = static_cast<std::uint8_t>(message[0] % 200 + 1);
    message.back() ^= 0x41U;
  }
  if (fault == LineFault::wrong_transaction && line.tcp) message.back() ^= 0x41U;
  if (fault == LineFault::wrong_transaction && !line.tcp) message[1] ^= 7U;
  if (fault == LineFault::exception_busy) {
    message = {message[0], static_cast<std::uint8_t>(message[1] | 0x80U), busy};
  }
  Bytes frame;
  if (line.tcp) {
    const int number = fault == LineFault::wrong_transaction ? (transaction ^ 0x0105) : transaction;
    const int length =
        static_cast<int>(message.size()) + (fault == LineFault::wrong_checksum ? 2 : 0);
    frame = {static_cast<std::uint8_t>(number >> 8), static_cast<std::uint8_t>(number), 0, 0,
             static_cast<std::uint8_t>(length >> 8), static_cast<std::uint8_t>(length)};
  }
  frame.insert(frame.end(), message.begin(), message.end());
  if (!line.tcp) {
    const std::uint16_t crc = checksum_of(message);
    frame.push_back(static_cast<std::uint8_t>(crc));
    frame.push_back(static_cast<std::uint8_t>(crc >> 8U));
    if (fault == LineFault::wrong_checksum) {
      frame[random_() % frame.size()] ^= static_cast<std::uint8_t>(1U << (random_() % 8));
    }
  }
  const std::int64_t now = now_();
  if (fault == LineFault::short_frame) frame.resize(1 + random_() % (frame.size() - 1));
  if (fault == LineFault::extra_bytes) {
    for (auto n = 1 + random_() % 6; n > 0; --n) {
      frame.push_back(static_cast<std::uint8_t>(random_()));
    }
  }
  if (fault == LineFault::repeated) {
    const Bytes once = frame;
    frame.insert(frame.end(), once.begin(), once.end());
  }
  if (fault == LineFault::torn) {
    const std::size_t cut = 1 + random_() % (frame.size() - 1);
    const auto at = frame.begin() + static_cast<std::ptrdiff_t>(cut);
    send(line.file, Bytes(frame.begin(), at), now);
    send(line.file, Bytes(at, frame.end()), now + piece_ns);
    return true;
  }
  send(line.file, frame, fault == LineFault::late ? now + late_ns : now);
  return true;
}

void EmulatedModbusUnits::send(int file, const Bytes& bytes, std::int64_t at_ns) {
  due_.push_back({at_ns, file, bytes});
  send_due();
}

void EmulatedModbusUnits::send_due() {
  const std::int64_t now = now_();
  std::stable_sort(due_.begin(), due_.end(),
                   [](const Due& a, const Due& b) { return a.time_ns < b.time_ns; });
  while (!due_.empty() && due_.front().time_ns <= now) {
    const Due due = due_.front();
    due_.erase(due_.begin());
    // A closed reader does not affect the units.
    if (::send(due.file, due.bytes.data(), due.bytes.size(), MSG_NOSIGNAL) < 0 &&
        errno == ENOTSOCK) {
      static_cast<void>(!::write(due.file, due.bytes.data(), due.bytes.size()));
    }
  }
}

}  // namespace stickslip::emulated
