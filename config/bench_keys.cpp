// SPDX-License-Identifier: Apache-2.0
// Keys of a rig file on a bench of real devices.
#include <array>
#include <string>

#include "config/rig_key_parts.h"

namespace stickslip::config {

namespace {

constexpr std::string_view on_bench = "driver.kind=bench";
constexpr std::string_view with_u6 = "driver.bench.board=labjack_u6";
constexpr std::string_view with_t7 = "driver.bench.board=labjack_t7";
constexpr std::string_view with_1208 = "driver.bench.board=usb_1208fs_plus";

/// DEVICE/INPUT; both are left empty where the text has another form.
void read_source(BenchInput& input, const std::string& from) {
  const auto slash = from.find('/');
  if (slash == std::string::npos || slash == 0 || slash + 1 == from.size()) return;
  input.device = from.substr(0, slash);
  input.input = from.substr(slash + 1);
}

void read_input(Rig& rig, std::size_t channel, const Value& value) {
  auto& input = rig.bench.inputs[channel];
  if (!input) input.emplace();
  read_source(*input, value.text());
}

template <auto Of>
void read_readback(Rig& rig, std::size_t, const Value& value) {
  auto& readback = rig.bench.readback.*Of;
  if (!readback) readback.emplace();
  read_source(readback->input, value.text());
}

constexpr Key readback_from(std::string_view path, std::string_view sentence) {
  return {.path = path,
          .sentence = sentence,
          .need = Need::in_table,
          .when = on_bench,
          .only_then = true};
}

constexpr Key readback_range(std::string_view path) {
  return {.path = path,
          .unit = "V",
          .sentence = "The range of that input is +- this, one of those of inputs.CHANNEL.range_v.",
          .when = on_bench,
          .only_then = true,
          .low = 0,
          .high = 20,
          .above_low = true};
}

constexpr Key readback_differential(std::string_view path) {
  return {.path = path,
          .sentence = "That input is measured relative to its partner.",
          .when = on_bench,
          .only_then = true};
}

constexpr Key readback_delay(std::string_view path, std::string_view without) {
  return {.path = path,
          .unit = "s",
          .sentence =
              "Longest time from a command to its reading; a fault is found within three of it.",
          .without = without,
          .when = on_bench,
          .only_then = true,
          .low = 0.01,
          .high = 5};
}

constexpr std::array bench_table = {
    bound<&Rig::bench, &Bench::board>(
        Key{.path = "driver.bench.board",
            .sentence = "The board whose scans are the frames, and whose output drives the shaker.",
            .need = Need::always,
            .when = on_bench,
            .only_then = true}),
    read_by<Rig, read_input>(
        Type::text,
        Key{.path = "inputs.*.from",
            .sentence =
                "Source of the channel, DEVICE/INPUT: labjack_u6/AIN0 or labjack_t7/AIN0 to "
                "AIN13, usb_1208fs_plus/CH0 to CH7, phidget_bridge/0 to 3, the name of a "
                "[[modbus]] unit and of a register in its map, or that of a [[gauge]] and "
                "its input. At least one is on the board.",
            .without = "not measured",
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::inputs, by_channel, &BenchInput::range_v>(Key{
        .path = "inputs.*.range_v",
        .unit = "V",
        .sentence =
            "Inputs of a board: the range is +- this. labjack_u6, labjack_t7: 10, 1, 0.1, 0.01; "
            "usb_1208fs_plus: 10, and with differential = true 20, 10, 5, 4, 2.5, 2, 1.25, 1.",
        .when = on_bench,
        .only_then = true,
        .low = 0,
        .high = 20,
        .above_low = true}),
    bound<&Rig::bench, &Bench::inputs, by_channel, &BenchInput::differential>(
        Key{.path = "inputs.*.differential",
            .sentence = "Inputs of a board: measured relative to its partner. LabJack: AIN0 and "
                        "AIN1, AIN2 and AIN3, and so on; usb_1208fs_plus: CH0 to CH3 are pairs.",
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::inputs, by_channel, &BenchInput::gain>(
        Key{.path = "inputs.*.gain",
            .unit = "1",
            .sentence = "Inputs of a bridge: 1, 8, 16, 32, 64 or 128; the range is 1/gain V/V.",
            .when = on_bench,
            .only_then = true,
            .low = 1,
            .high = 128}),
    bound<&Rig::bench, &Bench::shaker, &ShakerOutput::volts_per_unit>(
        Key{.path = "shaker.volts_per_unit",
            .unit = "V/m or V/N",
            .sentence = "Output voltage per metre of base displacement, or per newton; negative "
                        "for reversed polarity.",
            .need = Need::always,
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::shaker, &ShakerOutput::rest_v>(
        Key{.path = "shaker.rest_v",
            .unit = "V",
            .sentence = "Output voltage at rest.",
            .when = on_bench,
            .only_then = true,
            .low = -10,
            .high = 10}),
    bound<&Rig::bench, &Bench::shaker, &ShakerOutput::low_v>(
        Key{.path = "shaker.low_v",
            .unit = "V",
            .sentence = "Lower limit of the output voltage.",
            .when = on_bench,
            .only_then = true,
            .low = -10,
            .high = 10}),
    bound<&Rig::bench, &Bench::shaker, &ShakerOutput::high_v>(
        Key{.path = "shaker.high_v",
            .unit = "V",
            .sentence = "Upper limit of the output voltage.",
            .when = on_bench,
            .only_then = true,
            .low = -10,
            .high = 10}),
    bound<&Rig::bench, &Bench::labjack_u6, &LabjackU6::serial>(
        Key{.path = "labjack_u6.serial",
            .unit = "1",
            .sentence = "Serial number, as on the label.",
            .without = "the only one attached",
            .when = with_u6,
            .only_then = true,
            .low = 1,
            .high = 4294967295.0}),
    bound<&Rig::bench, &Bench::labjack_u6, &LabjackU6::resolution_index>(Key{
        .path = "labjack_u6.resolution_index",
        .unit = "1",
        .sentence = "Resolution of a stream: higher is quieter and slower; 0: the board's choice.",
        .when = with_u6,
        .only_then = true,
        .low = 0,
        .high = 8}),
    bound<&Rig::bench, &Bench::labjack_u6, &LabjackU6::settling>(
        Key{.path = "labjack_u6.settling",
            .unit = "1",
            .sentence = "Settling factor between two inputs of a scan; 0: the board's choice.",
            .when = with_u6,
            .only_then = true,
            .low = 0,
            .high = 9}),
    bound<&Rig::bench, &Bench::labjack_u6, &LabjackU6::samples_per_packet>(
        Key{.path = "labjack_u6.samples_per_packet",
            .unit = "1",
            .sentence =
                "Samples that the board collects before it sends them; fewer reduce the latency.",
            .without = "those of 5 ms",
            .when = with_u6,
            .only_then = true,
            .low = 1,
            .high = 25}),
    bound<&Rig::bench, &Bench::labjack_u6, &LabjackU6::transfers>(
        Key{.path = "labjack_u6.transfers",
            .unit = "1",
            .sentence = "Reads that are queued in the kernel.",
            .when = with_u6,
            .only_then = true,
            .low = 2,
            .high = 32}),
    bound<&Rig::bench, &Bench::labjack_u6, &LabjackU6::dac>(
        Key{.path = "labjack_u6.dac",
            .unit = "1",
            .sentence = "Output that drives the shaker's amplifier, DAC0 or DAC1.",
            .when = with_u6,
            .only_then = true,
            .low = 0,
            .high = 1}),
    bound<&Rig::bench, &Bench::labjack_u6, &LabjackU6::enable_line>(
        Key{.path = "labjack_u6.enable_line",
            .unit = "1",
            .sentence =
                "Digital line that enables the amplifier while high: 0-7 FIO, 8-15 EIO, 16-19 CIO.",
            .without = "not wired",
            .when = with_u6,
            .only_then = true,
            .low = 0,
            .high = 19}),
    bound<&Rig::bench, &Bench::labjack_u6, &LabjackU6::amplifier_fault_line>(
        Key{.path = "labjack_u6.amplifier_fault_line",
            .unit = "1",
            .sentence = "Digital line that is low while the amplifier has a fault.",
            .without = "not wired",
            .when = with_u6,
            .only_then = true,
            .low = 0,
            .high = 19}),
    bound<&Rig::bench, &Bench::labjack_u6, &LabjackU6::emergency_stop_line>(
        Key{.path = "labjack_u6.emergency_stop_line",
            .unit = "1",
            .sentence =
                "Digital line that is low while the emergency stop is pressed, or its wire is cut.",
            .without = "not wired",
            .when = with_u6,
            .only_then = true,
            .low = 0,
            .high = 19}),
    bound<&Rig::bench, &Bench::labjack_u6, &LabjackU6::watchdog_s>(
        Key{.path = "labjack_u6.watchdog_s",
            .unit = "s",
            .sentence =
                "Time without communication after which the board releases enable_line; 0: never.",
            .when = with_u6,
            .only_then = true,
            .low = 0,
            .high = 60}),
    bound<&Rig::bench, &Bench::labjack_t7, &LabjackT7::host>(
        Key{.path = "labjack_t7.host",
            .sentence = "Name or address of the board, such as 192.168.1.207.",
            .need = Need::always,
            .when = with_t7,
            .only_then = true}),
    bound<&Rig::bench, &Bench::labjack_t7, &LabjackT7::port>(
        Key{.path = "labjack_t7.port",
            .unit = "1",
            .sentence = "TCP port of its commands (Modbus TCP).",
            .when = with_t7,
            .only_then = true,
            .low = 1,
            .high = 65535}),
    bound<&Rig::bench, &Bench::labjack_t7, &LabjackT7::stream_port>(
        Key{.path = "labjack_t7.stream_port",
            .unit = "1",
            .sentence = "TCP port of its stream.",
            .when = with_t7,
            .only_then = true,
            .low = 1,
            .high = 65535}),
    bound<&Rig::bench, &Bench::labjack_t7, &LabjackT7::serial>(
        Key{.path = "labjack_t7.serial",
            .unit = "1",
            .sentence = "Serial number, as on the label: another board at that address is refused.",
            .without = "any board at that address",
            .when = with_t7,
            .only_then = true,
            .low = 1,
            .high = 4294967295.0}),
    bound<&Rig::bench, &Bench::labjack_t7, &LabjackT7::resolution_index>(Key{
        .path = "labjack_t7.resolution_index",
        .unit = "1",
        .sentence = "Resolution of a stream: higher is quieter and slower; 0: the board's choice.",
        .when = with_t7,
        .only_then = true,
        .low = 0,
        .high = 8}),
    bound<&Rig::bench, &Bench::labjack_t7, &LabjackT7::settling_us>(
        Key{.path = "labjack_t7.settling_us",
            .unit = "us",
            .sentence = "Settling time between two inputs of a scan; 0: the board's choice.",
            .when = with_t7,
            .only_then = true,
            .low = 0,
            .high = 4400}),
    bound<&Rig::bench, &Bench::labjack_t7, &LabjackT7::scans_per_packet>(Key{
        .path = "labjack_t7.scans_per_packet",
        .unit = "1",
        .sentence = "Scans that the board collects before it sends them; fewer reduce the latency.",
        .without = "those of 5 ms",
        .when = with_t7,
        .only_then = true,
        .low = 1,
        .high = 512}),
    bound<&Rig::bench, &Bench::labjack_t7, &LabjackT7::dac>(
        Key{.path = "labjack_t7.dac",
            .unit = "1",
            .sentence = "Output that drives the shaker's amplifier, DAC0 or DAC1.",
            .when = with_t7,
            .only_then = true,
            .low = 0,
            .high = 1}),
    bound<&Rig::bench, &Bench::labjack_t7, &LabjackT7::enable_line>(
        Key{.path = "labjack_t7.enable_line",
            .unit = "1",
            .sentence =
                "Digital line that enables the amplifier while high: 0-7 FIO, 8-15 EIO, 16-19 CIO, "
                "20-22 MIO.",
            .without = "not wired",
            .when = with_t7,
            .only_then = true,
            .low = 0,
            .high = 22}),
    bound<&Rig::bench, &Bench::labjack_t7, &LabjackT7::amplifier_fault_line>(
        Key{.path = "labjack_t7.amplifier_fault_line",
            .unit = "1",
            .sentence = "Digital line that is low while the amplifier has a fault.",
            .without = "not wired",
            .when = with_t7,
            .only_then = true,
            .low = 0,
            .high = 22}),
    bound<&Rig::bench, &Bench::labjack_t7, &LabjackT7::emergency_stop_line>(
        Key{.path = "labjack_t7.emergency_stop_line",
            .unit = "1",
            .sentence =
                "Digital line that is low while the emergency stop is pressed, or its wire is cut.",
            .without = "not wired",
            .when = with_t7,
            .only_then = true,
            .low = 0,
            .high = 22}),
    bound<&Rig::bench, &Bench::labjack_t7, &LabjackT7::watchdog_s>(
        Key{.path = "labjack_t7.watchdog_s",
            .unit = "s",
            .sentence =
                "Time without communication after which the board releases enable_line; 0: never.",
            .when = with_t7,
            .only_then = true,
            .low = 0,
            .high = 60}),
    bound<&Rig::bench, &Bench::usb_1208fs_plus, &Usb1208fsPlus::serial>(
        Key{.path = "usb_1208fs_plus.serial",
            .sentence = "Serial number, as on the label.",
            .without = "the only one attached",
            .when = with_1208,
            .only_then = true}),
    bound<&Rig::bench, &Bench::usb_1208fs_plus, &Usb1208fsPlus::output>(
        Key{.path = "usb_1208fs_plus.output",
            .unit = "1",
            .sentence = "Output that drives the shaker's amplifier, D/A OUT 0 or 1.",
            .when = with_1208,
            .only_then = true,
            .low = 0,
            .high = 1}),
    bound<&Rig::bench, &Bench::usb_1208fs_plus, &Usb1208fsPlus::output_ahead_s>(
        Key{.path = "usb_1208fs_plus.output_ahead_s",
            .unit = "s",
            .sentence = "Drive queued in the board: a delay, for an even pace.",
            .when = with_1208,
            .only_then = true,
            .low = 0.005,
            .high = 0.5}),
    bound<&Rig::bench, &Bench::phidget_bridge, &PhidgetBridge::serial>(
        Key{.path = "phidget_bridge.serial",
            .unit = "1",
            .sentence = "Serial number, as on the label.",
            .without = "the only one attached",
            .when = on_bench,
            .only_then = true,
            .low = 1,
            .high = 4294967295.0}),
    bound<&Rig::bench, &Bench::phidget_bridge, &PhidgetBridge::interval_ms>(
        Key{.path = "phidget_bridge.interval_ms",
            .unit = "ms",
            .sentence = "Sampling interval of all inputs; a multiple of 8.",
            .when = on_bench,
            .only_then = true,
            .low = 8,
            .high = 1000}),
    bound<&Rig::bench, &Bench::modbus>(
        Key{.path = "modbus",
            .sentence = "One [[modbus]] table for each unit, 64 at most.",
            .without = "none",
            .most = 64}),
    bound<&Rig::bench, &Bench::gauges>(
        Key{.path = "gauge",
            .sentence = "One [[gauge]] table for each other instrument, 64 at most.",
            .without = "none",
            .most = 64}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::chip>(
        Key{.path = "amplifier.chip",
            .sentence =
                "GPIO chip of the amplifier's contacts: /dev/gpiochip0, gpiochip0 or its label.",
            .need = Need::in_table,
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::heartbeat_period_s>(
        Key{.path = "amplifier.heartbeat_period_s",
            .unit = "s",
            .sentence = "Time between edges of the heartbeat.",
            .when = on_bench,
            .only_then = true,
            .low = 0.01,
            .high = 10}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::enable, &GpioLine::line>(
        Key{.path = "amplifier.enable.line",
            .sentence = "Output: enables the amplifier. The line's name, or its offset in digits.",
            .need = Need::in_table,
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::enable, &GpioLine::active_low>(
        Key{.path = "amplifier.enable.active_low",
            .sentence = "True: 0 V on that line is active.",
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::enable, &GpioLine::bias>(
        Key{.path = "amplifier.enable.bias",
            .sentence = "Bias resistor of the GPIO chip on that line, if available.",
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::heartbeat, &GpioLine::line>(Key{
        .path = "amplifier.heartbeat.line",
        .sentence = "Output: toggles while the loop runs, for a watchdog relay. The line's name, "
                    "or its offset in digits.",
        .need = Need::in_table,
        .when = on_bench,
        .only_then = true}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::heartbeat, &GpioLine::active_low>(
        Key{.path = "amplifier.heartbeat.active_low",
            .sentence = "True: 0 V on that line is active.",
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::heartbeat, &GpioLine::bias>(
        Key{.path = "amplifier.heartbeat.bias",
            .sentence = "Bias resistor of the GPIO chip on that line, if available.",
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::fault, &GpioLine::line>(Key{
        .path = "amplifier.fault.line",
        .sentence = "Input: the amplifier has a fault. The line's name, or its offset in digits.",
        .need = Need::in_table,
        .when = on_bench,
        .only_then = true}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::fault, &GpioLine::active_low>(
        Key{.path = "amplifier.fault.active_low",
            .sentence = "True: 0 V on that line is active.",
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::fault, &GpioLine::bias>(
        Key{.path = "amplifier.fault.bias",
            .sentence = "Bias resistor of the GPIO chip on that line, if available.",
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::emergency_stop, &GpioLine::line>(
        Key{.path = "amplifier.emergency_stop.line",
            .sentence =
                "Input: the emergency stop is pressed. The line's name, or its offset in digits.",
            .need = Need::in_table,
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::emergency_stop, &GpioLine::active_low>(
        Key{.path = "amplifier.emergency_stop.active_low",
            .sentence = "True: 0 V on that line is active.",
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::emergency_stop, &GpioLine::bias>(
        Key{.path = "amplifier.emergency_stop.bias",
            .sentence = "Bias resistor of the GPIO chip on that line, if available.",
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::fault, &GpioLine::debounce_s>(Key{
        .path = "amplifier.fault.debounce_s",
        .unit = "s",
        .sentence =
            "A fault is effective immediately, its end after the line was constant for this time.",
        .when = on_bench,
        .only_then = true,
        .low = 0,
        .high = 10}),
    bound<&Rig::bench, &Bench::amplifier, &Amplifier::emergency_stop, &GpioLine::debounce_s>(Key{
        .path = "amplifier.emergency_stop.debounce_s",
        .unit = "s",
        .sentence =
            "Pressing is effective immediately, release after the line was constant for this time.",
        .when = on_bench,
        .only_then = true,
        .low = 0,
        .high = 10}),
    read_by<Rig, read_readback<&Readback::drive>>(
        Type::text,
        readback_from("readback.drive.from",
                      "Spare input of the board at the output that drives the shaker, such as "
                      "labjack_u6/AIN12 or usb_1208fs_plus/CH7: an output that does not follow its "
                      "command is a fault (output_differs).")),
    bound<&Rig::bench, &Bench::readback, &Readback::drive, &DriveReadback::input,
          &BenchInput::range_v>(readback_range("readback.drive.range_v")),
    bound<&Rig::bench, &Bench::readback, &Readback::drive, &DriveReadback::input,
          &BenchInput::differential>(readback_differential("readback.drive.differential")),
    bound<&Rig::bench, &Bench::readback, &Readback::drive, &DriveReadback::gain>(
        Key{.path = "readback.drive.gain",
            .unit = "1",
            .sentence = "The reading is offset_v + gain times the output voltage; not 0.",
            .when = on_bench,
            .only_then = true,
            .low = -100,
            .high = 100}),
    bound<&Rig::bench, &Bench::readback, &Readback::drive, &DriveReadback::offset_v>(
        Key{.path = "readback.drive.offset_v",
            .unit = "V",
            .sentence = "Reading at an output of 0 V.",
            .when = on_bench,
            .only_then = true,
            .low = -20,
            .high = 20}),
    bound<&Rig::bench, &Bench::readback, &Readback::drive, &DriveReadback::tolerance_v>(
        Key{.path = "readback.drive.tolerance_v",
            .unit = "V",
            .sentence = "Tolerance of the reading.",
            .without = "1 % of the output's range, two of its steps and 0.1 % of range_v",
            .when = on_bench,
            .only_then = true,
            .low = 0,
            .high = 20,
            .above_low = true}),
    bound<&Rig::bench, &Bench::readback, &Readback::drive, &DriveReadback::delay_s>(
        readback_delay("readback.drive.delay_s",
                       "safety.longest_overrun_s, two packets, and 0.05 s; usb_1208fs_plus: "
                       "instead of 0.05 s, output_ahead_s and 0.2 s")),
    read_by<Rig, read_readback<&Readback::enable>>(
        Type::text, readback_from("readback.enable.from",
                                  "Spare input of the board at the amplifier's enable contact: a "
                                  "contact that does not follow its command is a fault "
                                  "(output_differs).")),
    bound<&Rig::bench, &Bench::readback, &Readback::enable, &EnableReadback::input,
          &BenchInput::range_v>(readback_range("readback.enable.range_v")),
    bound<&Rig::bench, &Bench::readback, &Readback::enable, &EnableReadback::input,
          &BenchInput::differential>(readback_differential("readback.enable.differential")),
    bound<&Rig::bench, &Bench::readback, &Readback::enable, &EnableReadback::on_above_v>(
        Key{.path = "readback.enable.on_above_v",
            .unit = "V",
            .sentence = "A higher reading shows the contact as on.",
            .when = on_bench,
            .only_then = true,
            .low = -20,
            .high = 20}),
    bound<&Rig::bench, &Bench::readback, &Readback::enable, &EnableReadback::active_low>(
        Key{.path = "readback.enable.active_low",
            .sentence = "True: a lower reading shows it as on.",
            .when = on_bench,
            .only_then = true}),
    bound<&Rig::bench, &Bench::readback, &Readback::enable, &EnableReadback::delay_s>(
        readback_delay("readback.enable.delay_s",
                       "safety.longest_overrun_s, two packets, 0.05 s for a relay, 0.05 s on a "
                       "LabJack board, and 0.3 s for a line of a GPIO chip")),
};

}  // namespace

std::span<const BoundKey<Rig>> bench_keys() { return bench_table; }

}  // namespace stickslip::config
