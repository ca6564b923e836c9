// SPDX-License-Identifier: Apache-2.0
// Arbitrary bytes from a serial scale: an accepted line has the exact format and a valid checksum;
// with one byte changed it is rejected. Lines are never counted twice.
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

#include "drivers/serial_scale/serial_scale.h"

namespace {

using namespace stickslip::drivers::serial_scale;

void require(bool holds, const char* what) {
  if (!holds) throw std::logic_error(what);
}

void look_at(std::string line, std::uint8_t other) {
  const auto weight = parse_line(line);
  if (!weight) return;
  require(line.size() <= 64 && line.ends_with("\r\n") && line.find('\n') == line.size() - 1,
          "one line, whole");
  unsigned sum = 0;
  const std::size_t star = line.size() - 5;
  require(line[star] == '*' && line[star - 1] == ' ', "a checksum stands where it should");
  for (std::size_t i = 0; i + 1 < star; ++i) sum ^= static_cast<std::uint8_t>(line[i]);
  require(std::stoul(line.substr(star + 1, 2), nullptr, 16) == sum, "the checksum is right");
  require(std::isfinite(weight->force_n), "weights are finite");
  require(weight->valid == (line[0] != 'E'), "an error is never valid");
  bool digits = false;
  for (std::size_t i = 0; i < star; ++i) digits |= std::isdigit(line[i]) != 0;
  require(weight->valid == digits, "a valid reading contains digits");
  for (char& each : line) {
    const char was = each;
    each = static_cast<char>(other);
    if (each != was) require(!parse_line(line), "one byte that is changed is seen");
    each = was;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view text(reinterpret_cast<const char*>(data), size);
  stickslip::drivers::MissedMessages missed(100'000'000, 0);
  std::int64_t time_ns = 0;
  std::uint64_t counted = 0;
  while (!text.empty()) {
    const auto length = std::min(text.find('\n'), text.size() - 1) + 1;
    const auto first = static_cast<std::uint8_t>(text.front());
    look_at(std::string(text.substr(0, length)), static_cast<std::uint8_t>(text.back()));
    look_at(std::string(text.substr(0, length)), static_cast<std::uint8_t>(first ^ length));
    text.remove_prefix(length);
    time_ns += std::int64_t{first} * 10'000'000;
    counted += missed.count(time_ns, first % 3);
    require(counted <= static_cast<std::uint64_t>(time_ns / 50'000'000),
            "no more is missing than there was time for");
  }
  return 0;
}
