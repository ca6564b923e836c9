// SPDX-License-Identifier: Apache-2.0
// A bench of real devices: the source of each channel, and the address and settings of each device.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/modbus_map.h"
#include "config/names.h"
#include "physics/frame.h"

namespace stickslip::config {

/// The board whose scans are the frames.
enum class BoardKind { labjack_u6, labjack_t7, usb_1208fs_plus };

template <>
inline constexpr auto names<BoardKind> = std::to_array<Name<BoardKind>>({
    {BoardKind::labjack_u6, "labjack_u6"},
    {BoardKind::labjack_t7, "labjack_t7"},
    {BoardKind::usb_1208fs_plus, "usb_1208fs_plus"},
});

/// [inputs.CHANNEL]: source of a channel. `from` in the file is DEVICE/INPUT.
struct BenchInput {
  /// "labjack_u6", "labjack_t7", "usb_1208fs_plus", "phidget_bridge", or a [[modbus]] name
  std::string device;
  std::string input;          ///< "AIN3"; "2" of a bridge; name of a register in the map
  double range_v = 10.0;      ///< boards: the range is +-range_v
  bool differential = false;  ///< boards: relative to the next input (AIN0 - AIN1)
  int gain = 1;               ///< bridges
};

/// By channel; empty if the bench does not measure it.
using BenchInputs = std::array<std::optional<BenchInput>, channel_count>;

/// Spare inputs of a board that read the outputs back, scanned after the channels; [readback].
struct ReadbackInputs {
  std::optional<BenchInput> drive_readback;
  std::optional<BenchInput> enable_readback;
};

/// Output, digital lines and watchdog of a LabJack board.
struct LabjackOutput : ReadbackInputs {
  int dac = 0;  ///< output to the amplifier, 0 or 1
  /// Digital lines: FIO0-7, EIO0-7, CIO0-3 are 0 to 19, MIO0-2 of the T7 20 to 22. Absent: not
  /// wired.
  std::optional<int> enable_line;  ///< high: the amplifier may be on
  std::optional<int>
      amplifier_fault_line;  ///< low: fault (also with a cut wire, which is pulled down)
  std::optional<int> emergency_stop_line;  ///< low: pressed, or its wire is cut
  int watchdog_s = 2;   ///< the firmware releases enable_line after this silence; 0: never
  double rest_v = 2.5;  ///< output voltage at rest; [shaker] rest_v

  /// True if the board's watchdog guards the enable line.
  bool has_watchdog() const { return watchdog_s > 0 && enable_line.has_value(); }
};

/// [labjack_u6]
struct LabjackU6 : LabjackOutput {
  std::optional<std::uint32_t> serial;    ///< absent: the only one attached
  int resolution_index = 0;               ///< 0 to 8, of StreamConfig
  int settling = 0;                       ///< settling factor of StreamConfig
  std::optional<int> samples_per_packet;  ///< 1 to 25; absent: those of 5 ms
  int transfers = 8;                      ///< stream transfers in flight
};

/// [labjack_t7]
struct LabjackT7 : LabjackOutput {
  std::string host;                     ///< name or address
  int port = 502;                       ///< of its Modbus TCP server
  int stream_port = 702;                ///< to which it sends its stream
  std::optional<std::uint32_t> serial;  ///< absent: the board at `host`, whichever it is
  int resolution_index = 0;             ///< 0 to 8, of the stream
  double settling_us = 0.0;             ///< 0 to 4400, between two inputs; 0: the board's choice
  std::optional<int> scans_per_packet;  ///< absent: those of 5 ms
};

/// [usb_1208fs_plus]
struct Usb1208fsPlus : ReadbackInputs {
  std::string serial;            ///< 8 characters; empty: the only one attached
  int output = 0;                ///< output to the amplifier, 0 or 1
  double output_ahead_s = 0.02;  ///< drive queued in the board: a delay, but no gaps
  double rest_v = 2.5;           ///< output voltage at rest; [shaker] rest_v
};

/// [phidget_bridge], PhidgetBridge 4-Input 1046
struct PhidgetBridge {
  std::optional<std::uint32_t> serial;  ///< absent: the only one attached
  int interval_ms = 8;                  ///< 8 to 1000, a multiple of 8; for all inputs
};

enum class ModbusTransport { rtu, tcp };

template <>
inline constexpr auto names<ModbusTransport> = std::to_array<Name<ModbusTransport>>({
    {ModbusTransport::rtu, "rtu"},
    {ModbusTransport::tcp, "tcp"},
});

/// Parity of a serial line, by the letters of ModbusUnit::parity.
inline constexpr auto parities =
    std::to_array<Name<char>>({{'N', "none"}, {'E', "even"}, {'O', "odd"}});

/// Who switches the transceiver of a two-wire RS-485 line between sending and receiving.
enum class Rs485Direction {
  automatic,  ///< the adapter, by itself
  kernel,     ///< the driver of the serial port, by its RTS line (TIOCSRS485)
  rts         ///< stickslipd, by the RTS line of the port
};

template <>
inline constexpr auto names<Rs485Direction> = std::to_array<Name<Rs485Direction>>({
    {Rs485Direction::automatic, "automatic"},
    {Rs485Direction::kernel, "kernel"},
    {Rs485Direction::rts, "rts"},
});

/// State of the RTS line. Asserted: positive on RS-232, 0 V on the pin of most converters.
enum class RtsState { asserted, released };

template <>
inline constexpr auto names<RtsState> = std::to_array<Name<RtsState>>({
    {RtsState::asserted, "asserted"},
    {RtsState::released, "released"},
});

/// One [[modbus]] table: a unit. Units with the same port share one bus.
struct ModbusUnit {
  std::string name;
  ModbusTransport transport = ModbusTransport::rtu;
  std::string port;  ///< RTU: "/dev/ttyUSB0"; TCP: "host:502" or "[::1]:502"
  int baud = 19200;
  char parity = 'E';  ///< N, E or O
  int stop_bits = 1;
  Rs485Direction direction = Rs485Direction::automatic;
  RtsState rts_while_sending = RtsState::asserted;  ///< directions kernel and rts
  int unit = 1;                                     ///< 1 to 247; 255 as well for TCP
  ModbusMap map;
  std::filesystem::path map_file;
  double poll_period_s = 0.05;
  double timeout_s = 0.1;
  int retries = 2;  ///< repetitions of a request before it counts as failed
  double pause_between_requests_s = 0.0;
  double pause_after_connect_s = 0.0;
};

/// Kind of an instrument that needs no settings but its port.
enum class GaugeKind { serial_scale };

template <>
inline constexpr auto names<GaugeKind> = std::to_array<Name<GaugeKind>>({
    {GaugeKind::serial_scale, "serial_scale"},
});

/// One [[gauge]] table.
struct GaugeAt {
  std::string name;
  GaugeKind kind = GaugeKind::serial_scale;
  std::string port;  ///< "/dev/ttyUSB1"
  int baud = 9600;   ///< of a serial line
};

/// One line of a GPIO chip.
struct GpioLine {
  enum class Bias { as_is, disabled, pull_up, pull_down };
  std::string line;  ///< its name, or its offset in digits
  bool active_low = false;
  Bias bias = Bias::as_is;
  double debounce_s = 0.0;  ///< inputs: a level counts after this time without a change
};

template <>
inline constexpr auto names<GpioLine::Bias> = std::to_array<Name<GpioLine::Bias>>({
    {GpioLine::Bias::as_is, "as_is"},
    {GpioLine::Bias::disabled, "disabled"},
    {GpioLine::Bias::pull_up, "pull_up"},
    {GpioLine::Bias::pull_down, "pull_down"},
});

/// [amplifier]: its contacts on GPIO lines. Logical levels: active means enabled, fault, pressed.
struct Amplifier {
  std::string chip;  ///< "/dev/gpiochip0", "gpiochip0", or a label
  std::optional<GpioLine> enable;
  std::optional<GpioLine> fault;
  std::optional<GpioLine> emergency_stop;
  std::optional<GpioLine> heartbeat;  ///< toggles while the loop runs; for a watchdog relay
  double heartbeat_period_s = 0.1;    ///< from edge to edge
};

/// [shaker]: conversion of the commanded base displacement (or force) to the board's output
/// voltage.
struct ShakerOutput {
  double volts_per_unit = 0.0;  ///< [V/m], or [V/N] on force-excited rigs; may be negative
  double rest_v = 2.5;          ///< at rest
  double low_v = 0.0;           ///< lower limit
  double high_v = 5.0;          ///< upper limit
};

/// [readback.drive]: a spare input of the board at the output that drives the shaker.
struct DriveReadback {
  BenchInput input;
  double gain = 1.0;                  ///< the reading is offset_v + gain times the output voltage
  double offset_v = 0.0;              ///< reading at an output of 0 V
  std::optional<double> tolerance_v;  ///< of the reading; absent: limits_of()
  std::optional<double> delay_s;      ///< longest, from command to reading; absent: limits_of()
};

/// [readback.enable]: a spare input of the board at the amplifier's enable contact.
struct EnableReadback {
  BenchInput input;
  double on_above_v = 2.0;        ///< a higher reading shows the contact as on
  bool active_low = false;        ///< a lower one does
  std::optional<double> delay_s;  ///< longest, from command to reading; absent: limits_of()
};

struct Readback {
  std::optional<DriveReadback> drive;
  std::optional<EnableReadback> enable;
  double longest_overrun_s = 0.05;  ///< of the loop; [safety] longest_overrun_s
};

/// [driver] kind = "bench"
struct Bench {
  BoardKind board = BoardKind::labjack_u6;
  BenchInputs inputs{};
  ShakerOutput shaker;
  LabjackU6 labjack_u6;
  LabjackT7 labjack_t7;
  Usb1208fsPlus usb_1208fs_plus;
  PhidgetBridge phidget_bridge;
  std::vector<ModbusUnit> modbus;
  std::vector<GaugeAt> gauges;
  std::optional<Amplifier> amplifier;
  Readback readback;
};

/// Those of the board of the bench; null if it has none.
const LabjackOutput* output_of(const Bench& bench);

/// Those of the inputs that belong to a device.
BenchInputs inputs_of(const BenchInputs& inputs, const std::string& device);

}  // namespace stickslip::config
