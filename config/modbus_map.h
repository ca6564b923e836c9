// What a Modbus unit keeps where: a file of its own, so that a conditioner is described once and
// used on every bench.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace stickslip::config {

enum class RegisterTable { coils, discrete_inputs, holding_registers, input_registers };

/// `bit` is a coil or a discrete input; bcd16 and bcd32 hold one decimal digit in four bits.
enum class RegisterType {
  bit,
  uint16,
  int16,
  uint32,
  int32,
  int64,
  float32,
  float64,
  bcd16,
  bcd32
};

/// In which order the bytes of a value of two registers travel, A the most significant. Values of
/// four registers: CDAB turns the order of the registers around, BADC that of the bytes within
/// each, DCBA both.
enum class ByteOrder { abcd, cdab, badc, dcba };

enum class RegisterRole {
  reading,  ///< a value that a channel may come from
  status,   ///< has to be one of `ok`, else nothing that the unit says is believed
  alarm,    ///< has to be one of `ok`, else the amplifier has a fault
  setting,  ///< is given `set_to` when the unit is opened, and read back
};

/// One [[register]] table.
struct ModbusRegister {
  std::string name;
  RegisterRole role = RegisterRole::reading;
  RegisterTable table = RegisterTable::holding_registers;
  int address = 0;  ///< as it travels: counted from 0
  RegisterType type = RegisterType::uint16;
  ByteOrder order = ByteOrder::abcd;
  double scale = 1.0;  ///< value = raw * scale + offset
  double offset = 0.0;
  std::string unit;              ///< of the value: "mm"
  std::string group;             ///< registers of one group travel in one request; empty: alone
  std::vector<std::int64_t> ok;  ///< status, alarm: raw values that are well
  std::optional<double> set_to;  ///< setting: the value
  bool write_single = false;     ///< setting: function 6 (5 for coils), else 16 (15)
};

struct ModbusMap {
  std::string name;  ///< "Orbit ACS"
  std::vector<ModbusRegister> registers;
};

/// Registers of that type take so many 16-bit words on the wire (a bit: 1).
std::size_t registers_of(RegisterType type);

/// One request reads at most so many: 2000 bits, or 125 registers of 16 bits (the protocol's own
/// limit).
int most_in_one(RegisterTable table);

/// Reads a register map. Throws InputError with every problem that was found, each with file, line
/// and column.
ModbusMap load_modbus_map(const std::filesystem::path& file);
ModbusMap parse_modbus_map(std::string_view text, const std::string& name);

}  // namespace stickslip::config
