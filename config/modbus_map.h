// SPDX-License-Identifier: Apache-2.0
// Register map of a kind of Modbus unit: a separate file, so that a conditioner is described once
// and used on every bench.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/names.h"

namespace stickslip::config {

enum class RegisterTable { coils, discrete_inputs, holding_registers, input_registers };

template <>
inline constexpr auto names<RegisterTable> = std::to_array<Name<RegisterTable>>({
    {RegisterTable::coils, "coils"},
    {RegisterTable::discrete_inputs, "discrete_inputs"},
    {RegisterTable::holding_registers, "holding_registers"},
    {RegisterTable::input_registers, "input_registers"},
});

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

template <>
inline constexpr auto names<RegisterType> = std::to_array<Name<RegisterType>>({
    {RegisterType::bit, "bit"},
    {RegisterType::uint16, "uint16"},
    {RegisterType::int16, "int16"},
    {RegisterType::uint32, "uint32"},
    {RegisterType::int32, "int32"},
    {RegisterType::int64, "int64"},
    {RegisterType::float32, "float32"},
    {RegisterType::float64, "float64"},
    {RegisterType::bcd16, "bcd16"},
    {RegisterType::bcd32, "bcd32"},
});

/// Order of transmission of the bytes of a value of two registers, A the most significant. For
/// values of four registers CDAB reverses the registers, BADC the bytes in each, DCBA both.
enum class ByteOrder { abcd, cdab, badc, dcba };

template <>
inline constexpr auto names<ByteOrder> = std::to_array<Name<ByteOrder>>({
    {ByteOrder::abcd, "abcd"},
    {ByteOrder::cdab, "cdab"},
    {ByteOrder::badc, "badc"},
    {ByteOrder::dcba, "dcba"},
});

enum class RegisterRole {
  reading,  ///< a possible source of a channel
  status,   ///< if not one of `ok`, all readings of the unit are invalid
  alarm,    ///< if not one of `ok`, the amplifier has a fault
  setting,  ///< written with `set_to` when the unit is opened, and read back
};

template <>
inline constexpr auto names<RegisterRole> = std::to_array<Name<RegisterRole>>({
    {RegisterRole::reading, "reading"},
    {RegisterRole::status, "status"},
    {RegisterRole::alarm, "alarm"},
    {RegisterRole::setting, "setting"},
});

/// One [[register]] table.
struct ModbusRegister {
  std::string name;
  RegisterRole role = RegisterRole::reading;
  RegisterTable table = RegisterTable::holding_registers;
  int address = 0;  ///< in the protocol: counted from 0
  RegisterType type = RegisterType::uint16;
  ByteOrder order = ByteOrder::abcd;
  double scale = 1.0;  ///< value = raw * scale + offset
  double offset = 0.0;
  std::string unit;                  ///< of the value: "mm"
  std::string group;                 ///< registers of a group are read in one request; empty: alone
  std::vector<std::int64_t> ok;      ///< status, alarm: good raw values
  std::optional<std::int64_t> mask;  ///< status, alarm: bits compared with `ok`; none: all
  std::optional<double> set_to;      ///< setting: the value
  bool write_single = false;         ///< setting: function 6 (5 for coils), else 16 (15)
};

struct ModbusMap {
  std::string name;  ///< "Orbit ACS"
  std::vector<ModbusRegister> registers;
};

/// Number of 16-bit words of a value on the wire (a bit: 1).
std::size_t registers_of(RegisterType type);

/// Largest number of bits (2000) or 16-bit registers (125) in one request, by the protocol.
int max_per_request(RegisterTable table);

/// Reads a register map. Throws InputError with every problem found, each with file, line, column.
ModbusMap load_modbus_map(const std::filesystem::path& file);
ModbusMap parse_modbus_map(std::string_view text, const std::string& name);

}  // namespace stickslip::config
