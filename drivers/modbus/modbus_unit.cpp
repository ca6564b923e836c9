// SPDX-License-Identifier: Apache-2.0
#include "drivers/modbus/modbus_unit.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <utility>

#include "drivers/modbus/value.h"
#include "physics/number_text.h"

namespace stickslip::drivers {

namespace {

using config::ModbusRegister;
using config::RegisterRole;
using config::RegisterTable;
using modbus::Exchange;
using modbus::Progress;

/// Longest time that a read waits.
constexpr std::int64_t read_wait_ns = 150'000'000;
/// Number of consecutive invalid replies after which a wrong setting is assumed rather than
/// interference.
constexpr int max_invalid_replies = 20;
/// Number of consecutive failed polls after which an alarm is unknown.
constexpr int polls_until_unknown = 5;

std::int64_t ns(double seconds) { return std::llround(seconds * 1.0e9); }

std::string name_of(const config::ModbusUnit& reg) {
  return (reg.map.name.empty() ? std::string("Modbus unit") : reg.map.name) + " \"" + reg.name +
         "\" (unit " + std::to_string(reg.unit) + " on " + reg.port + ")";
}

const char* name_of(RegisterTable table) {
  switch (table) {
    case RegisterTable::coils:
      return "coil";
    case RegisterTable::discrete_inputs:
      return "discrete input";
    case RegisterTable::input_registers:
      return "input register";
    case RegisterTable::holding_registers:
      break;
  }
  return "holding register";
}

std::string title_of(const ModbusRegister& reg) {
  return "\"" + reg.name + "\" (" + name_of(reg.table) + " " + std::to_string(reg.address) + ")";
}

template <typename Numbers>
std::string listed(const Numbers& numbers, const char* between) {
  std::string text;
  for (const auto one : numbers) {
    if (!text.empty()) text += between;
    text += std::to_string(one);
  }
  return text;
}

bool has_role(const config::ModbusMap& map, RegisterRole role) {
  return std::any_of(map.registers.begin(), map.registers.end(),
                     [role](const ModbusRegister& reg) { return reg.role == role; });
}

std::optional<std::size_t> find_reading(const config::ModbusMap& map, const std::string& name) {
  for (std::size_t i = 0; i < map.registers.size(); ++i) {
    if (map.registers[i].name == name && map.registers[i].role == RegisterRole::reading) return i;
  }
  return std::nullopt;
}

}  // namespace

ModbusUnit::ModbusUnit(config::ModbusUnit settings, std::vector<std::string> inputs,
                       std::shared_ptr<modbus::ModbusBus> bus, HostClock& clock)
    : settings_(std::move(settings)),
      name_(name_of(settings_)),
      bus_(std::move(bus)),
      clock_(clock),
      plan_(modbus::plan_requests(settings_.map, {inputs.begin(), inputs.end()})),
      has_alarm_(has_role(settings_.map, RegisterRole::alarm)),
      alarm_(has_alarm_) {
  for (std::string& input : inputs) {
    const auto at = find_reading(settings_.map, input);
    input_registers_.push_back(at);
    inputs_.push_back(
        {settings_.name, std::move(input), at ? settings_.map.registers[*at].unit : ""});
  }
  caller_.unit = settings_.unit;
  caller_.timeout_ns = ns(settings_.timeout_s);
  caller_.pause_between_requests_ns = ns(settings_.pause_between_requests_s);
  caller_.pause_after_connect_ns = ns(settings_.pause_after_connect_s);
}

ModbusUnit::~ModbusUnit() { close(); }

Result ModbusUnit::report(Outcome outcome, std::string text) {
  message_ = name_ + ": " + std::move(text);
  return {outcome, message_.c_str()};
}

Signals ModbusUnit::signals() const noexcept {
  Signals signals;
  signals.amplifier_fault = alarm_.load(std::memory_order_relaxed);
  return signals;
}

Result ModbusUnit::check_map() {
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    if (!input_registers_[i]) {
      return report(Outcome::needs_attention, "its map " + settings_.map_file.string() +
                                                  " has no reading \"" + inputs_[i].name +
                                                  "\", which an input requires");
    }
  }
  return {};
}

Result ModbusUnit::open() {
  close();
  if (const Result checked = check_map(); !checked) return checked;
  std::string why;
  if (const Outcome connected = bus_->connect(why); connected != Outcome::ok) {
    return report(connected, why);
  }
  losses_ = {};
  consecutive_timeouts_ = 0;
  consecutive_invalid_replies_ = 0;
  consecutive_failed_polls_ = 0;
  const Result opened = open_all();
  // A unit that was switched off may have been unlocked meanwhile.
  if (opened.outcome == Outcome::lost) rejected_.clear();
  if (!opened) return opened;
  due_ns_ = clock_.now_ns();
  status_was_ok_ = true;
  open_ = true;
  return {};
}

Result ModbusUnit::open_all() {
  for (std::size_t i = 0; i < settings_.map.registers.size(); ++i) {
    const ModbusRegister& reg = settings_.map.registers[i];
    if (reg.role != RegisterRole::setting || !reg.set_to) continue;
    if (const Result applied = apply_setting(i); !applied) return applied;
  }
  // Checks that the unit responds and has all of these registers.
  std::vector<std::uint16_t> words;
  for (std::size_t i = 0; i < plan_.requests.size(); ++i) {
    const Result checked =
        request_with_retries(modbus::read_message(settings_.unit, plan_.requests[i]), names_in(i),
                             words, settings_.retries);
    if (!checked) return checked;
  }
  return {};
}

Result ModbusUnit::apply_setting(std::size_t at) {
  const ModbusRegister& reg = settings_.map.registers[at];
  const auto words = modbus::words_for(reg, *reg.set_to);
  if (!words) {
    return report(Outcome::needs_attention, "setting " + title_of(reg) + " cannot represent " +
                                                physics::number_text(*reg.set_to, 9) +
                                                ": check its type and scale");
  }
  const std::string what = "setting " + title_of(reg);
  const auto read = modbus::read_message(settings_.unit,
                                         {reg.table, reg.address, static_cast<int>(words->count)});
  const auto write = modbus::write_message(settings_.unit, reg.table, reg.address, words->view(),
                                           reg.write_single);
  const auto wanted = words->view();
  Result written{Outcome::no_data, ""};
  for (int writes = 0;; ++writes) {
    std::vector<std::uint16_t> held;
    if (const Result received = request_with_retries(read, what, held, settings_.retries);
        !received) {
      return received;
    }
    const auto refusal = rejected_.find(at);
    if (std::equal(held.begin(), held.end(), wanted.begin(), wanted.end())) {
      if (refusal != rejected_.end()) rejected_.erase(refusal);
      return {};
    }
    if (written || (refusal != rejected_.end() && refusal->second == held)) {
      rejected_[at] = held;
      return report(Outcome::needs_attention,
                    what + " was set to " + physics::number_text(*reg.set_to, 9) + " (" +
                        listed(wanted, " ") + ") and reads back " + listed(held, " ") +
                        ": the unit rejects that value, or is locked. It is not written again "
                        "until the unit is power-cycled or the daemon restarted");
    }
    if (writes > settings_.retries) return written;
    // Once: a write without a reply may have succeeded, so the register is read before a retry.
    std::vector<std::uint16_t> echo;
    written = request_with_retries(write, what, echo, 0);
    if (!written && written.outcome != Outcome::temporary) return written;
  }
}

/// A request with its retries; blocks until it is completed.
Result ModbusUnit::request_with_retries(std::span<const std::uint8_t> request,
                                        const std::string& what, std::vector<std::uint16_t>& words,
                                        int retries) {
  Result result;
  for (int attempt = 0; attempt <= retries; ++attempt) {
    Exchange exchange;
    do {
      exchange = bus_->exchange(caller_, request, clock_.now_ns() + read_wait_ns);
      losses_.rejected += exchange.rejected;
    } while (exchange.progress == Progress::waiting);
    if (exchange.progress == Progress::answered) {
      consecutive_timeouts_ = 0;
      consecutive_invalid_replies_ = 0;
      words = std::move(exchange.words);
      return {};
    }
    result = failed(exchange, what);
    if (result.outcome != Outcome::temporary) break;
  }
  return result;
}

Result ModbusUnit::read(std::span<Reading> readings) {
  if (!open_) return {Outcome::fatal, "read of a Modbus unit that is not open"};
  const std::int64_t until = clock_.now_ns() + read_wait_ns;
  if (answered_.empty()) {
    clock_.sleep_until(std::min(due_ns_, until));
    if (due_ns_ > until) return {Outcome::no_data, ""};
  }
  bool complete = false;
  const Result polled = poll_until(until, complete);
  if (!complete) return polled;
  const Result taken = take(readings);
  next_poll();
  return taken;
}

Result ModbusUnit::poll_until(std::int64_t until_ns, bool& complete) {
  while (answered_.size() < plan_.requests.size()) {
    const std::size_t at = answered_.size();
    Exchange exchange =
        bus_->exchange(caller_, modbus::read_message(settings_.unit, plan_.requests[at]), until_ns);
    losses_.rejected += exchange.rejected;
    if (exchange.progress == Progress::waiting) return {Outcome::no_data, ""};
    if (exchange.progress != Progress::answered) return failed(exchange, names_in(at));
    consecutive_timeouts_ = 0;
    consecutive_invalid_replies_ = 0;
    const std::int64_t took_ns = exchange.received_ns - exchange.sent_ns;
    answered_.push_back({std::move(exchange.words), exchange.sent_ns + took_ns / 2,
                         std::llround(static_cast<double>(took_ns) / (2.0 * std::numbers::sqrt3))});
  }
  complete = true;
  return {};
}

Result ModbusUnit::failed(const Exchange& exchange, const std::string& what) {
  switch (exchange.progress) {
    case Progress::exception:
      return refused(exchange.exception, what);
    case Progress::silent:
      return silent(what);
    case Progress::garbled:
      return garbled(exchange, what);
    default:
      break;
  }
  abandon_poll();
  set_alarm_unknown();
  return report(Outcome::lost, exchange.why);
}

Result ModbusUnit::silent(const std::string& what) {
  const std::string words = "no reply to " + what + " within " +
                            physics::number_text(1.0e3 * settings_.timeout_s, 9) + " ms";
  if (++consecutive_timeouts_ <= settings_.retries) return report(Outcome::temporary, words);
  abandon_poll();
  set_alarm_unknown();
  return report(Outcome::lost, words + ", " + std::to_string(consecutive_timeouts_) +
                                   " times: is it on, is its address " +
                                   std::to_string(settings_.unit) +
                                   ", are A and B swapped, do baud rate and parity match, is "
                                   "timeout_s long enough?");
}

Result ModbusUnit::garbled(const Exchange& exchange, const std::string& what) {
  const std::string words = "the reply to " + what + " is invalid: " + exchange.why;
  if (++consecutive_invalid_replies_ > settings_.retries) abandon_poll();
  if (consecutive_invalid_replies_ < max_invalid_replies) return report(Outcome::temporary, words);
  set_alarm_unknown();
  return report(
      Outcome::needs_attention,
      words + ", " + std::to_string(consecutive_invalid_replies_) +
          " times in a row: check baud rate, parity, termination, duplicate addresses, and an "
          "adapter that receives its own transmission");
}

Result ModbusUnit::refused(std::uint8_t exception, const std::string& what) {
  const std::string words = "replies to " + what + " with exception " + std::to_string(exception) +
                            ", " + modbus::name_of_exception(exception);
  if (exception == 11) return silent(what + " (exception 11, gateway)");
  abandon_poll();
  switch (exception) {
    case 1:
    case 2:
    case 3:
    case 10:
      set_alarm_unknown();
      return report(Outcome::needs_attention,
                    words + (exception == 10 ? ": check the settings of the gateway"
                                             : ": its map does not match this unit"));
    default:
      return report(Outcome::temporary, words);
  }
}

void ModbusUnit::set_alarm_unknown() noexcept {
  if (has_alarm_) alarm_.store(true, std::memory_order_relaxed);
}

/// Ends a failed poll.
void ModbusUnit::abandon_poll() {
  if (!open_) return;
  losses_.missing += std::max<std::size_t>(inputs_.size(), 1);
  if (++consecutive_failed_polls_ >= polls_until_unknown) set_alarm_unknown();
  next_poll();
}

void ModbusUnit::next_poll() {
  answered_.clear();
  const std::int64_t period = std::max<std::int64_t>(ns(settings_.poll_period_s), 1);
  due_ns_ += period;
  // Missed polls are skipped; the phase of the period is kept.
  const std::int64_t now = clock_.now_ns();
  if (now <= due_ns_) return;
  const std::int64_t skipped = (now - due_ns_) / period;
  losses_.missing += static_cast<std::uint64_t>(skipped) * inputs_.size();
  due_ns_ += skipped * period;
}

std::span<const std::uint16_t> ModbusUnit::words_of(std::size_t at) const {
  const modbus::Place place = *plan_.places[at];
  return std::span(answered_[place.request].words)
      .subspan(place.first, config::registers_of(settings_.map.registers[at].type));
}

std::string ModbusUnit::names_in(std::size_t request) const {
  std::string names;
  for (std::size_t i = 0; i < plan_.places.size(); ++i) {
    if (!plan_.places[i] || plan_.places[i]->request != request) continue;
    names += (names.empty() ? "" : ", ") + title_of(settings_.map.registers[i]);
  }
  return names;
}

std::string ModbusUnit::fault_of(RegisterRole role) const {
  for (std::size_t i = 0; i < settings_.map.registers.size(); ++i) {
    const ModbusRegister& reg = settings_.map.registers[i];
    if (reg.role != role) continue;
    const auto raw = modbus::raw_of(reg, words_of(i));
    if (raw && std::find(reg.ok.begin(), reg.ok.end(), *raw) != reg.ok.end()) continue;
    return title_of(reg) + " is " + (raw ? std::to_string(*raw) : "not an integer") +
           ", expected " + listed(reg.ok, " or ");
  }
  return {};
}

Result ModbusUnit::take(std::span<Reading> readings) {
  consecutive_failed_polls_ = 0;
  if (has_alarm_) {
    alarm_.store(!fault_of(RegisterRole::alarm).empty(), std::memory_order_relaxed);
  }
  const std::string problem = fault_of(RegisterRole::status);
  for (std::size_t i = 0; i < inputs_.size() && i < readings.size(); ++i) {
    const std::size_t at = *input_registers_[i];
    const auto value = modbus::value_of(settings_.map.registers[at], words_of(at));
    readings[i].time_ns = answered_[plan_.places[at]->request].time_ns;
    readings[i].sigma_ns = answered_[plan_.places[at]->request].sigma_ns;
    readings[i].valid = value.has_value() && problem.empty();
    readings[i].value = value.value_or(0.0);
  }
  const bool was_ok = std::exchange(status_was_ok_, problem.empty());
  if (problem.empty() || !was_ok) return {};
  return report(Outcome::temporary, "status " + problem + ": its readings are not valid");
}

void ModbusUnit::close() noexcept {
  bus_->leave(caller_);
  set_alarm_unknown();
  answered_.clear();
  open_ = false;
}

std::vector<std::unique_ptr<Gauge>> make_modbus_gauges(const std::vector<config::ModbusUnit>& units,
                                                       const config::BenchInputs& inputs,
                                                       HostClock& clock) {
  std::map<std::pair<config::ModbusTransport, std::string>, std::shared_ptr<modbus::ModbusBus>>
      buses;
  std::vector<std::unique_ptr<Gauge>> gauges;
  for (const config::ModbusUnit& unit : units) {
    std::vector<std::string> names;
    for (const auto& input : inputs) {
      if (!input || input->device != unit.name) continue;
      if (std::find(names.begin(), names.end(), input->input) == names.end()) {
        names.push_back(input->input);
      }
    }
    const bool always_polled = has_role(unit.map, RegisterRole::alarm) ||
                               has_role(unit.map, RegisterRole::status) ||
                               has_role(unit.map, RegisterRole::setting);
    if (names.empty() && !always_polled) continue;
    auto& bus = buses[{unit.transport, unit.port}];
    if (!bus) bus = std::make_shared<modbus::ModbusBus>(unit, clock);
    gauges.push_back(std::make_unique<ModbusUnit>(unit, std::move(names), bus, clock));
  }
  return gauges;
}

}  // namespace stickslip::drivers
