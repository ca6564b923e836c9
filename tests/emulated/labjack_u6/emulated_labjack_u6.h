// SPDX-License-Identifier: Apache-2.0
// An emulated LabJack U6 at the level of its USB cable: commands, analogue inputs, outputs, digital
// lines, the firmware watchdog, and the stream, with individual crystal error and calibration.
// Written from the vendor's protocol documentation, not from a driver.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "tests/emulated/labjack_u6/calibration.h"
#include "tests/emulated/labjack_u6/stream.h"
#include "tests/emulated/usb_device.h"
#include "tests/emulated/wires.h"

namespace stickslip::emulated {

struct LabjackU6Options {
  std::uint32_t serial = 360009876;
  bool pro = false;
  std::uint8_t firmware_major = 1;
  std::uint8_t firmware_minor = 43;
  std::uint8_t local_id = 1;
  std::uint64_t seed = 1;          ///< of calibration constants, noise and random faults
  double crystal_error_ppm = 0.0;  ///< positive: fast
  double noise = 1.0;              ///< relative to that of a real converter; 0: none
  int drive_dac = 0;               ///< the output wired to the amplifier
  /// Digital lines, 0 to 19; absent: not connected.
  std::optional<int> enable_line;           ///< high: enabled; pulled down by the contact
  std::optional<int> amplifier_fault_line;  ///< low: fault
  std::optional<int> emergency_stop_line;   ///< low: pressed
  std::optional<int> drive_input;           ///< AIN wired to the output of the drive
  std::optional<int> enable_input;          ///< AIN wired to the enable contact: 5 V while on
};

/// Faults of a reply.
enum class U6ReplyFault : std::uint8_t {
  late,     ///< sent `late_ns` after the command was executed
  missing,  ///< the command is executed without a reply
  error,    ///< the command is not executed; the reply holds `error`
  bad_checksum,
  stall,  ///< the response endpoint stalls; the reply follows clear_halt
};

struct U6ReplyFaultDetail {
  std::int64_t late_ns = 0;
  std::uint8_t error = 0;
};

/// Any thread may call it; calls are serialized.
class EmulatedLabjackU6 final : public UsbDevice {
 public:
  static constexpr std::uint16_t vendor_id = 0x0CD5;
  static constexpr std::uint16_t product_id = 6;

  EmulatedLabjackU6(Wires& wires, Now now, LabjackU6Options options = {});

  /// Connects AIN0 to AIN13 against ground [V]; others read 0 V. A differential channel reads its
  /// input minus the next one.
  void wire(int input, Sensor sensor);

  Bytes device_descriptor() const override;
  Bytes configuration_descriptor() const override;
  std::string string(std::uint8_t index) const override;
  UsbAnswer control(const UsbSetup& setup, std::span<const std::uint8_t> out) override;
  UsbStatus out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) override;
  UsbAnswer in(std::uint8_t endpoint, std::size_t capacity) override;
  void clear_halt(std::uint8_t endpoint_address) override;
  void reset() override;

  /// Performs due actions (watchdog, scans) without a call from the bus, for tests with a dead
  /// host.
  void catch_up();

  /// For packet number `packet` of the stream, from 0 at each start.
  void schedule(U6StreamFault fault, std::uint64_t packet);
  /// For every packet from now on.
  void chance(U6StreamFault fault, double probability);
  /// For the reply after `skip` others (0: the next one).
  void schedule(U6ReplyFault fault, std::uint64_t skip = 0, U6ReplyFaultDetail detail = {});
  /// For every reply from now on.
  void chance(U6ReplyFault fault, double probability, U6ReplyFaultDetail detail = {});
  /// The output keeps its voltage, whatever is commanded.
  void set_dac_stuck(bool stuck);
  /// The amplifier's contact keeps its state, whatever its line does; afterwards it follows it.
  void set_contact_stuck(bool stuck);
  /// The contact opens and stays open, as by a broken wire.
  void open_contact();
  /// While silent it accepts commands and data without replies.
  void set_silent(bool silent);

  // True state, for tests.
  const U6Calibration& calibration() const { return calibration_; }
  /// Every scan since the start of the stream, by index, including lost ones.
  std::vector<U6Scan> scans() const;
  std::uint64_t scans_lost() const;  ///< by FIFO overflows, since the start of the stream
  std::uint64_t recoveries() const;
  std::vector<U6FaultyPacket> faulty_packets() const;
  std::uint64_t packets() const;        ///< since the start of the stream, including those not sent
  std::size_t samples_waiting() const;  ///< in its buffer
  bool streaming() const;
  double dac_volts(int dac) const;
  bool line_is_output(int line) const;
  bool line_is_high(int line) const;
  std::uint64_t watchdog_trips() const;
  bool watchdog_armed() const;  ///< set before a stream; refused during it, as no source permits it
  std::uint64_t resets() const;    ///< by command, by the bus or by the watchdog
  std::uint64_t commands() const;  ///< received in total
  /// True if every answer was read by the host.
  bool answers_taken() const;

 private:
  struct Answer {
    Bytes bytes;
    std::int64_t ready_ns = 0;
    bool stall_first = false;
  };
  struct Watchdog {
    std::uint8_t options = 0;
    std::uint16_t timeout_s = 0;
    std::uint8_t dio = 0;
    std::int64_t fed_ns = 0;
    bool armed() const { return timeout_s != 0 && (options & 0x30U) != 0; }
    std::int64_t due_ns() const { return fed_ns + std::int64_t{timeout_s} * 1'000'000'000; }
  };
  struct Feedback;

  void catch_up_locked();
  void trip_watchdog(std::int64_t time_ns);
  void power_up(std::int64_t time_ns);
  void command(std::span<const std::uint8_t> bytes);
  void extended_command(std::span<const std::uint8_t> bytes);
  void answer(Bytes bytes);
  struct ReplyFate {
    std::optional<U6ReplyFault> fault;
    U6ReplyFaultDetail detail;
  };
  ReplyFate fate_of_reply();
  std::uint8_t injected_error();

  Bytes config_u6(std::span<const std::uint8_t> bytes);
  Bytes config_io(std::span<const std::uint8_t> bytes);
  Bytes read_memory(std::span<const std::uint8_t> bytes, bool calibration);
  Bytes stream_config(std::span<const std::uint8_t> bytes);
  Bytes watchdog_command(std::span<const std::uint8_t> bytes);
  Bytes feedback(std::span<const std::uint8_t> bytes);
  std::uint8_t io_type(Feedback& feedback);
  std::uint8_t analog_input(Feedback& feedback, std::uint8_t type);
  std::uint8_t digital(Feedback& feedback, std::uint8_t type);
  std::uint8_t ports(Feedback& feedback, std::uint8_t type);
  Bytes stream_command(bool start);
  Bytes reset_command(std::span<const std::uint8_t> bytes);

  double volts(int input, bool differential, std::int64_t time_ns);
  double converted(const U6ConverterCalibration& adc, int gain, double volts);
  std::uint16_t stream_counts(const U6StreamChannel& channel, std::int64_t time_ns, double& volts);
  bool level(int line) const;
  void set_dac(std::size_t dac, std::uint16_t counts, std::int64_t time_ns);
  void update_enable(std::int64_t time_ns);

  mutable std::mutex lock_;
  Wires& wires_;
  Now now_;
  LabjackU6Options options_;
  U6Calibration calibration_;
  std::mt19937_64 noise_;
  std::mt19937_64 chance_;
  std::map<int, Sensor> inputs_;
  U6Stream stream_;
  std::deque<Answer> answers_;
  bool response_stalled_ = false;
  bool silent_ = false;
  bool dac_stuck_ = false;
  bool contact_stuck_ = false;
  std::array<std::uint16_t, 2> dac_counts_{};
  std::uint32_t direction_ = 0;  // bit set: output
  std::uint32_t latch_ = 0;      // bit set: output high
  std::optional<bool> enabled_;  // last state reported to the wires
  Watchdog watchdog_;
  std::array<std::uint8_t, 3> io_config_{};
  std::uint8_t local_id_;
  std::uint64_t trips_ = 0;
  std::uint64_t resets_ = 0;
  std::uint64_t commands_ = 0;
  std::uint64_t replies_ = 0;
  std::map<std::uint64_t, std::pair<U6ReplyFault, U6ReplyFaultDetail>> reply_faults_;
  std::map<U6ReplyFault, std::pair<double, U6ReplyFaultDetail>> reply_chances_;
};

}  // namespace stickslip::emulated
