// SPDX-License-Identifier: Apache-2.0
#include "drivers/serial_scale/serial_scale.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>

namespace stickslip::drivers {

constexpr double standard_gravity = 9.80665;  // [m/s^2]
constexpr std::size_t max_line_bytes = 64;    // longer than any valid line
constexpr std::int64_t nominal_interval_ns = 100'000'000;
constexpr std::int64_t read_wait_ns = 190'000'000;

namespace serial_scale {

std::optional<Weight> parse_line(std::string_view line) {
  std::array<std::string_view, 3> field;  // status, number, unit
  std::string_view rest = line;
  for (std::string_view& each : field) {
    each = rest.substr(0, rest.find(' '));
    rest.remove_prefix(std::min(each.size() + 1, rest.size()));
  }
  unsigned sum = 0;
  for (const char each : line.substr(0, line.rfind(' '))) sum ^= static_cast<unsigned char>(each);
  std::array<char, 8> checksum{};
  std::snprintf(checksum.data(), checksum.size(), "*%02X\r\n", sum & 0xFFU);
  if (rest != checksum.data() || (field[2] != "g" && field[2] != "kg")) return std::nullopt;
  const std::string_view number = field[1];
  if (line.size() > max_line_bytes || number.empty()) return std::nullopt;
  if (field[0] == "E" && number.find_first_not_of('-') == number.npos) return Weight{};
  const std::string_view digits = number.substr(1);
  const std::size_t point = digits.find('.');
  const bool valid = (field[0] == "S" || field[0] == "M") &&
                     (number[0] == '+' || number[0] == '-') && point > 0 &&
                     digits.find_first_not_of(".0123456789") == digits.npos &&
                     point < digits.size() - 1 && digits.rfind('.') == point;
  if (!valid) return std::nullopt;
  double value = 0.0;  // from_chars does not accept a plus sign
  std::from_chars(number.begin() + (number[0] == '+' ? 1 : 0), number.end(), value);
  return Weight{value * (field[2] == "g" ? 1.0e-3 : 1.0) * standard_gravity, true};
}

}  // namespace serial_scale

SerialScale::SerialScale(const config::GaugeAt& settings, const config::BenchInputs& inputs,
                         HostClock& clock)
    : settings_(settings), name_("serial scale \"" + settings.name + "\""), clock_(clock) {
  for (const auto& input : inputs) {
    if (input) inputs_.push_back({input->device, input->input, "N"});
  }
}

Result SerialScale::report(Outcome outcome, const std::string& text) {
  message_ = name_ + ": " + text;
  return {outcome, message_.c_str()};
}

Result SerialScale::open() {
  losses_ = {};
  received_.clear();
  for (const GaugeInput& input : inputs_) {
    if (input.name == "weight") continue;
    return report(Outcome::needs_attention, "no input \"" + input.name + "\"; it has weight only");
  }
  std::string why;
  const Outcome opened = line_.open(settings_.port, settings_.baud, why);
  missed_messages_ = MissedMessages(nominal_interval_ns, clock_.now_ns());
  arrivals_ = ArrivalScatter(nominal_interval_ns);
  return opened == Outcome::ok ? Result{} : report(opened, why);
}

Result SerialScale::read(std::span<Reading> readings) {
  if (!line_.is_open()) return {Outcome::fatal, "read of a serial scale that is not open"};
  const std::int64_t until = clock_.now_ns() + read_wait_ns;
  while (received_.find('\n') == std::string::npos && received_.size() <= max_line_bytes) {
    const Outcome received = line_.receive(received_, clock_, until);
    if (received == Outcome::lost)
      return report(received, settings_.port + " is disconnected; plug it in");
    if (received != Outcome::no_data) continue;
    losses_.missing += missed_messages_.count(clock_.now_ns(), 0);
    return {Outcome::no_data, ""};
  }
  return take_lines(readings);
}

Result SerialScale::take_lines(std::span<Reading> readings) {
  const std::int64_t now = clock_.now_ns();
  std::uint64_t lines = 0;
  std::uint64_t valid = 0;
  for (std::size_t end = 0; (end = received_.find('\n')) != std::string::npos; ++lines) {
    const auto weight = serial_scale::parse_line(std::string_view(received_).substr(0, end + 1));
    const std::int64_t start_ns = now - line_.duration_ns(received_.size());
    received_.erase(0, end + 1);
    if (!weight) continue;
    ++valid;
    arrivals_.add(start_ns);
    std::fill(readings.begin(), readings.end(),
              Reading{weight->force_n, start_ns, weight->valid, arrivals_.sigma_ns()});
  }
  if (received_.size() > max_line_bytes) {  // without an end
    received_.clear();
    ++lines;
  }
  losses_.rejected += lines - valid;
  losses_.missing += missed_messages_.count(now, lines);
  if (valid > 0) return {};
  return report(Outcome::temporary, "its lines are invalid; if this persists, check baud");
}

}  // namespace stickslip::drivers
