// SPDX-License-Identifier: Apache-2.0
// Arbitrary bytes as parameters of a Modbus request, a register map and a reply: an accepted reply
// matches the request, and a value can be written and read back.
//
// Layout: table, address (2), count, type, order, TCP flag, number of registers in the map, four
// bytes for each of those, and the reply.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <stdexcept>
#include <string>

#include "drivers/modbus/adu.h"
#include "drivers/modbus/plan.h"
#include "drivers/modbus/value.h"

namespace {

using namespace stickslip;
using namespace stickslip::drivers::modbus;
using config::ModbusRegister;
using config::RegisterType;

void require(bool holds, const char* what) {
  if (!holds) throw std::logic_error(what);
}

class Taken {
 public:
  explicit Taken(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  int byte() {
    if (bytes_.empty()) return 0;
    const int first = bytes_.front();
    bytes_ = bytes_.subspan(1);
    return first;
  }
  int word() {
    const int high = byte();
    return 256 * high + byte();
  }
  std::span<const std::uint8_t> rest() const { return bytes_; }

 private:
  std::span<const std::uint8_t> bytes_;
};

bool is_of_bits(config::RegisterTable table) {
  return table == config::RegisterTable::coils || table == config::RegisterTable::discrete_inputs;
}

void look_at_values(const std::vector<std::uint16_t>& words, config::ByteOrder order) {
  for (int type = 0; type < 10; ++type) {
    ModbusRegister reg;
    reg.type = static_cast<RegisterType>(type);
    reg.order = order;
    const std::size_t size = registers_of(reg.type);
    if (words.size() < size) continue;
    const auto own = std::span(words).first(size);
    const auto value = value_of(reg, own);
    const auto raw = raw_of(reg, own);
    require(!raw || value, "what has a raw number has a value");
    if (!value) continue;
    require(std::isfinite(*value), "values are finite");
    if (reg.type == RegisterType::int64) continue;  // not exactly representable as double
    const auto again = words_for(reg, *value);
    // Values instead of words, because of the two zeros.
    require(again && value_of(reg, again->view()) == value, "a value is written as it was read");
  }
}

void look_at_plan(const config::ModbusMap& map, const std::set<std::string>& needed) {
  const Plan plan = plan_requests(map, needed);
  require(plan.places.size() == map.registers.size(), "a place for every register");
  for (std::size_t i = 0; i < plan.places.size(); ++i) {
    if (!plan.places[i]) continue;
    const ModbusRegister& reg = map.registers[i];
    const ReadRequest& request = plan.requests.at(plan.places[i]->request);
    require(request.table == reg.table && request.count <= max_per_request(reg.table),
            "requests are of one table and not too long");
    require(
        plan.places[i]->first + registers_of(reg.type) <= static_cast<std::size_t>(request.count),
        "registers lie in their requests");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Taken taken(std::span(data, size));
  ReadRequest wanted;
  wanted.table = static_cast<config::RegisterTable>(taken.byte() % 4);
  wanted.address = taken.word();
  wanted.count = 1 + taken.byte() % 125;
  const auto order = static_cast<config::ByteOrder>(taken.byte() % 4);
  const bool tcp = taken.byte() % 2 == 1;
  config::ModbusMap map;
  std::set<std::string> needed;
  for (int left = taken.byte() % 16; left > 0; --left) {
    ModbusRegister reg;
    reg.name = std::to_string(left);
    reg.address = taken.word();
    const int kind = taken.byte();
    reg.table = static_cast<config::RegisterTable>(kind % 4);
    reg.role = static_cast<config::RegisterRole>(kind / 4 % 4);
    reg.type =
        is_of_bits(reg.table) ? RegisterType::bit : static_cast<RegisterType>(1 + kind / 16 % 9);
    reg.group = std::string(static_cast<std::size_t>(taken.byte() % 3), 'g');
    if (left % 2 == 0) needed.insert(reg.name);
    map.registers.push_back(reg);
  }
  look_at_plan(map, needed);

  const Bytes request = read_message(1, wanted);
  std::span<const std::uint8_t> frame = taken.rest();
  if (tcp) {
    const auto transaction = transaction_of(frame);
    if (!transaction) return 0;
    const Bytes again = with_tcp_header(*transaction, frame.subspan(tcp_header_size));
    require(std::equal(again.begin(), again.end(), frame.begin(), frame.end()),
            "a header is written as it was read");
    frame = frame.subspan(tcp_header_size);
  }
  const Reply reply = match_reply(request, frame);
  if (reply.verdict == Verdict::answer) {
    require(reply.words.size() == static_cast<std::size_t>(wanted.count), "the requested number");
    require(frame[0] == request[0] && frame[1] == request[1], "of that unit and function");
    look_at_values(reply.words, order);
  } else {
    require(reply.words.empty(), "no answer, no words");
  }
  return 0;
}
