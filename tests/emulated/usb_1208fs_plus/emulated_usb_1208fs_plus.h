// SPDX-License-Identifier: Apache-2.0
// An emulated MCC USB-1208FS-Plus: commands are vendor requests, samples arrive by bulk endpoint 1
// and the drive is sent by bulk endpoint 2.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "tests/emulated/usb_device.h"
#include "tests/emulated/wires.h"

namespace stickslip::emulated {

/// One scan of the inputs.
struct Usb1208fsPlusScan {
  std::int64_t time_ns = 0;   ///< of its first conversion, on the clock of the test
  std::vector<double> volts;  ///< input voltages at their conversions, ascending
  bool begins = false;        ///< first scan after a start command
};

/// Its own clock paces the scans of inputs and outputs: a scan begins at the start command (that of
/// the outputs with the first complete scan in the FIFO after it). The input pacer clocks the
/// converter: a scan of n inputs lasts n of its periods. External clocks and triggers are not
/// emulated.
class EmulatedUsb1208fsPlus final : public UsbDevice {
 public:
  static constexpr std::size_t terminals = 8;

  /// Correction of a converter code: true = code * slope + offset.
  struct Correction {
    float slope = 1.0F;
    float offset = 0.0F;
  };

  struct Options {
    std::string serial = "01A2B3C4";  ///< 8 characters
    /// At the terminals CH0 to CH7 [V]; absent: 0 V. A differential channel is the even terminal
    /// against the odd one.
    std::array<std::optional<Sensor>, terminals> sensors;
    double noise_v = 0.0;    ///< standard deviation, of each sample
    std::uint64_t seed = 1;  ///< of noise, imperfections and faults
    /// The converter has errors of some percent, with corrections in the calibration memory.
    bool imperfect = true;
    std::size_t output = 0;                       ///< index of the output wired to the shaker
    std::optional<std::size_t> output_terminal;   ///< wired to that output
    std::optional<std::size_t> contact_terminal;  ///< at a contact: 5 V while it is closed
    std::function<bool()> contact_closed;         ///< with contact_terminal
    double crystal = 0.0;                         ///< relative excess of the pacer rate
    std::size_t input_fifo_bytes = 12288;
    std::size_t output_fifo_bytes = 4096;
  };

  /// The first three are probabilities per packet.
  struct Faults {
    double short_packet = 0.0;     ///< truncated
    double repeated_packet = 0.0;  ///< sent twice
    double lost_packet = 0.0;
    bool stall = false;    ///< endpoint 1 stalls once, until it is cleared
    bool silence = false;  ///< no data at endpoint 1 while the scan continues
  };
  struct InjectedFaults {
    std::uint64_t short_packet = 0;
    std::uint64_t repeated_packet = 0;
    std::uint64_t lost_packet = 0;
    std::uint64_t stall = 0;
    std::uint64_t input_samples_dropped = 0;  ///< by a full FIFO, with "do not stall"
  };

  EmulatedUsb1208fsPlus(Options options, Wires& wires, Now now);

  /// May be changed between calls.
  Faults faults;
  const InjectedFaults& injected() const { return injected_; }
  /// Every complete scan since construction, including lost ones, over unplugging.
  const std::vector<Usb1208fsPlusScan>& scans() const { return scans_; }
  double output_v(std::size_t output) const;
  std::uint64_t output_scans_done() const { return output_.done; }
  std::size_t output_fifo_level() const { return output_.fifo.size(); }
  /// Its calibration memory, 768 bytes.
  Bytes& calibration_memory() { return calibration_; }

  /// The outputs keep their voltage, whatever is sent.
  void set_outputs_stuck(bool stuck);

  /// Removes the power: 0 V. A later reset() restores it.
  void unplug();

  Bytes device_descriptor() const override;
  Bytes configuration_descriptor() const override;
  std::string string(std::uint8_t index) const override;
  UsbAnswer control(const UsbSetup& setup, std::span<const std::uint8_t> out) override;
  UsbStatus out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) override;
  UsbAnswer in(std::uint8_t endpoint, std::size_t capacity) override;
  void clear_halt(std::uint8_t endpoint_address) override;
  void reset() override;

 private:
  /// Times of input conversions or output scans.
  struct Pace {
    std::int64_t start_ns = 0;
    double period_ns = 0.0;
    std::uint64_t ticks = 0;
    std::int64_t due_ns() const {
      return start_ns + static_cast<std::int64_t>(static_cast<double>(ticks) * period_ns + 0.5);
    }
  };
  struct InputScan {
    bool running = false;
    bool overrun = false;
    bool halted = false;
    bool differential = false;
    bool immediate = false;
    bool never_stalls = false;
    std::vector<std::size_t> channels;  // ascending
    std::uint64_t samples_wanted = 0;   // 0: unlimited
    std::uint64_t samples_taken = 0;
    Pace pace;
    std::deque<Bytes> packets;  // ready to send
    Bytes filling;
    std::size_t bytes = 0;  // in both
  };
  struct OutputScan {
    bool running = false;
    bool waiting = false;  // for the first data
    bool underrun = false;
    bool halted = false;
    bool never_stalls = false;
    std::uint8_t mask = 0;
    std::uint64_t scans_wanted = 0;
    std::uint64_t done = 0;
    Pace pace;
    std::deque<std::uint8_t> fifo;
    std::size_t taken_of_transfer = 0;
  };

  void catch_up();
  void take_sample();
  void keep(std::uint16_t code);
  void finish_input();
  void put_scan();
  void start_output_if_ready();
  void set_output(std::size_t output, std::uint16_t counts, std::int64_t time_ns);
  std::uint16_t convert(std::size_t channel, bool differential, int range, std::int64_t time_ns);
  std::uint16_t code(std::size_t channel, bool differential, int range, double volts) const;
  double input_v(std::size_t channel, bool differential, std::int64_t time_ns);
  void record(std::size_t place, std::int64_t time_ns, double volts);
  double terminal_v(std::size_t terminal, std::int64_t time_ns);
  Correction correction(std::size_t channel, bool differential, int range) const;
  void write_calibration();
  UsbAnswer read(const UsbSetup& setup);
  UsbStatus write(const UsbSetup& setup, std::span<const std::uint8_t> out);
  UsbStatus start_input(std::span<const std::uint8_t> out);
  UsbStatus start_output(std::span<const std::uint8_t> out);
  void clear_input_fifo();
  std::uint16_t status() const;
  bool next_packet(Bytes& packet);
  bool chance(double probability, std::uint64_t& count);

  Options options_;
  Wires& wires_;
  Now now_;
  Bytes calibration_;
  Bytes user_memory_;
  std::array<std::uint8_t, terminals> ranges_{};
  InputScan input_;
  OutputScan output_;
  std::array<std::uint16_t, 2> counts_{};
  std::optional<Bytes> again_;  // a repeated packet
  bool plugged_ = true;
  bool outputs_stuck_ = false;
  std::mt19937_64 noise_;
  std::mt19937_64 fate_;
  InjectedFaults injected_;
  std::vector<Usb1208fsPlusScan> scans_;
};

}  // namespace stickslip::emulated
