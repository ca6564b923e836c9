// SPDX-License-Identifier: Apache-2.0
// Keys of the [[gauge]] and [[modbus]] tables of a rig file, and of a register map.
#include <array>

#include "config/key_binding.h"

namespace stickslip::config {

namespace {

constexpr std::array gauge_table = {
    bound<&GaugeAt::name>(
        Key{.path = "name",
            .sentence = "Name of the instrument, for inputs.CHANNEL.from and for messages.",
            .need = Need::always}),
    bound<&GaugeAt::kind>(
        Key{.path = "kind",
            .sentence = "Kind of instrument; docs/hardware.md describes how to add one.",
            .need = Need::always}),
    bound<&GaugeAt::port>(
        Key{.path = "port", .sentence = "Serial device, /dev/ttyUSB1.", .need = Need::always}),
    bound<&GaugeAt::baud>(Key{.path = "baud",
                              .unit = "Bd",
                              .sentence = "Speed of its serial line.",
                              .low = 300,
                              .high = 921600}),
};

constexpr std::array unit_table = {
    bound<&ModbusUnit::name>(
        Key{.path = "name",
            .sentence = "Name of the unit, for inputs.CHANNEL.from and for messages.",
            .need = Need::always}),
    bound<&ModbusUnit::transport>(
        Key{.path = "transport", .sentence = "Serial line or network.", .need = Need::always}),
    bound<&ModbusUnit::port>(Key{
        .path = "port",
        .sentence = "rtu: the serial device, /dev/ttyUSB0; tcp: HOST:PORT, 192.168.0.5:502. Units "
                    "with the same port share one bus.",
        .need = Need::always}),
    bound<&ModbusUnit::baud>(Key{.path = "baud",
                                 .unit = "Bd",
                                 .sentence = "Speed of the serial line.",
                                 .when = "transport=rtu",
                                 .only_then = true,
                                 .low = 300,
                                 .high = 921600}),
    bound_by_names<parities, &ModbusUnit::parity>(Key{.path = "parity",
                                                      .sentence = "Parity of the serial line.",
                                                      .when = "transport=rtu",
                                                      .only_then = true}),
    bound<&ModbusUnit::stop_bits>(Key{.path = "stop_bits",
                                      .unit = "1",
                                      .sentence = "Stop bits of the serial line.",
                                      .when = "transport=rtu",
                                      .only_then = true,
                                      .low = 1,
                                      .high = 2}),
    bound<&ModbusUnit::direction>(
        Key{.path = "direction",
            .sentence = "Who switches a two-wire RS-485 line between sending and receiving. "
                        "automatic: the adapter, by itself. kernel: the driver of the port, by "
                        "RTS. rts: stickslipd, by RTS, for ports whose driver cannot.",
            .when = "transport=rtu",
            .only_then = true}),
    bound<&ModbusUnit::rts_while_sending>(
        Key{.path = "rts_while_sending",
            .sentence = "State of RTS in which the adapter sends. asserted: positive on RS-232, "
                        "0 V on the RTS pin of a logic-level converter.",
            .when = "direction=kernel|rts",
            .only_then = true}),
    bound<&ModbusUnit::unit>(
        Key{.path = "unit",
            .unit = "1",
            .sentence = "Address of the unit on its bus: 1 to 247; 255 for tcp only.",
            .low = 1,
            .high = 255}),
    bound<&ModbusUnit::map_file>(
        Key{.path = "map", .sentence = "Register map of the unit.", .need = Need::always}),
    bound<&ModbusUnit::poll_period_s>(Key{.path = "poll_period_s",
                                          .unit = "s",
                                          .sentence = "Interval between readings.",
                                          .low = 0.001,
                                          .high = 3600}),
    bound<&ModbusUnit::timeout_s>(Key{.path = "timeout_s",
                                      .unit = "s",
                                      .sentence = "Longest time for an answer.",
                                      .low = 0.005,
                                      .high = 10}),
    bound<&ModbusUnit::retries>(
        Key{.path = "retries",
            .unit = "1",
            .sentence = "Repetitions of a request before it counts as failed.",
            .low = 0,
            .high = 10}),
    bound<&ModbusUnit::pause_between_requests_s>(
        Key{.path = "pause_between_requests_s",
            .unit = "s",
            .sentence = "Silence on the bus before each request to this unit.",
            .low = 0,
            .high = 1}),
    bound<&ModbusUnit::pause_after_connect_s>(
        Key{.path = "pause_after_connect_s",
            .unit = "s",
            .sentence = "Time without requests to the unit after the bus was opened.",
            .low = 0,
            .high = 10}),
};

constexpr std::array map_table = {
    schema_key<ModbusMap>(),
    bound<&ModbusMap::name>(Key{.path = "name", .sentence = "Kind of unit.", .need = Need::always}),
    bound<&ModbusMap::registers>(Key{.path = "register",
                                     .sentence = "One [[register]] table for each, 256 at most.",
                                     .need = Need::always,
                                     .most = 256}),
};

constexpr std::array register_table = {
    bound<&ModbusRegister::name>(
        Key{.path = "name", .sentence = "Name of the register.", .need = Need::always}),
    bound<&ModbusRegister::role>(Key{
        .path = "role",
        .sentence = "reading: a possible source of a channel. status: if not one of `ok`, all "
                    "readings of the unit are invalid. alarm: if not one of `ok`, the amplifier "
                    "has a fault. setting: written with `set_to` when the unit is opened."}),
    bound<&ModbusRegister::table>(
        Key{.path = "table", .sentence = "Table of the unit that contains it."}),
    bound<&ModbusRegister::address>(
        Key{.path = "address",
            .unit = "1",
            .sentence = "Address in the protocol, from 0: holding register 40001 of a manual is 0.",
            .need = Need::always,
            .low = 0,
            .high = 65535}),
    bound<&ModbusRegister::type>(Key{.path = "type", .sentence = "Data type of the register."}),
    bound<&ModbusRegister::order>(
        Key{.path = "order", .sentence = "Order of the bytes of a value, A the most significant."}),
    bound<&ModbusRegister::scale>(
        Key{.path = "scale", .unit = "1", .sentence = "Value = raw scale + offset; not 0."}),
    bound<&ModbusRegister::offset>(
        Key{.path = "offset", .unit = "its own", .sentence = "Value = raw scale + offset."}),
    bound<&ModbusRegister::unit>(
        Key{.path = "unit", .sentence = "Unit of the value.", .without = "none"}),
    bound<&ModbusRegister::group>(
        Key{.path = "group",
            .sentence = "Registers of one group are read in one request, which spans at most 125 "
                        "registers, gaps included, or 2000 bits.",
            .without = "alone"}),
    bound<&ModbusRegister::ok>(
        Key{.path = "ok",
            .sentence = "Raw values of a status or an alarm without a fault.",
            .need = Need::always,
            .when = "role=status|alarm",
            .only_then = true}),
    bound<&ModbusRegister::mask>(Key{
        .path = "mask",
        .unit = "1",
        .sentence = "Bits of a status or an alarm that are compared with `ok`: 6 for bits 1 and "
                    "2, counted from 0.",
        .without = "all bits",
        .when = "role=status|alarm",
        .only_then = true,
        .low = 1}),
    bound<&ModbusRegister::set_to>(Key{.path = "set_to",
                                       .unit = "its own",
                                       .sentence = "Value written to a setting.",
                                       .need = Need::always,
                                       .when = "role=setting",
                                       .only_then = true}),
    bound<&ModbusRegister::write_single>(
        Key{.path = "write_single",
            .sentence = "True: a setting is written by function 6 (5), for units without 16 (15).",
            .when = "role=setting",
            .only_then = true}),
};

}  // namespace

template <>
std::span<const Key> keys_of<GaugeAt>() {
  static const std::vector<Key> keys = joined<GaugeAt>({gauge_table});
  return keys;
}

template <>
std::span<const Key> keys_of<ModbusUnit>() {
  static const std::vector<Key> keys = joined<ModbusUnit>({unit_table});
  return keys;
}

template <>
std::span<const Key> keys_of<ModbusMap>() {
  static const std::vector<Key> keys = joined<ModbusMap>({map_table});
  return keys;
}

template <>
std::span<const Key> keys_of<ModbusRegister>() {
  static const std::vector<Key> keys = joined<ModbusRegister>({register_table});
  return keys;
}

}  // namespace stickslip::config
