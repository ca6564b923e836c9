// SPDX-License-Identifier: Apache-2.0
// A bench of real devices as one driver: a board whose scans are the frames, gauges that are read
// in addition, and the amplifier's contacts.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/bench/gauge_reader.h"
#include "drivers/bench/output_checks.h"
#include "drivers/clock/host_clock.h"
#include "drivers/clock/stream_clock.h"
#include "drivers/contacts.h"
#include "drivers/driver.h"

namespace stickslip::drivers {

/// The devices of a bench.
struct BenchParts {
  std::unique_ptr<HostClock> clock;  ///< also that of the devices
  std::unique_ptr<Driver> board;     ///< frames and drive in V
  std::vector<std::unique_ptr<Gauge>> gauges;
  std::unique_ptr<Contacts> amplifier;  ///< null: none
};

/// Frames are those of the board, in V, on the host's clock (the first of a stream once their time
/// is known: clock/stream_clock.h), with the latest reading of each gauge that is not newer than
/// the scan, in the gauge's unit, and its age. The loss of a gauge invalidates its channels while
/// its thread tries to reopen it; the loss of the board or the amplifier is a loss of the driver,
/// which the owner closes and reopens. The device of the amplifier's contacts is opened first; the
/// contacts switch off before the board's output and on after it. A temporary failure of the board
/// does not switch them.
class BenchDriver final : public Driver {
 public:
  /// `inputs` assigns channels to inputs of gauges; those of the board are handled by the board.
  BenchDriver(BenchParts parts, const config::BenchInputs& inputs,
              const config::ShakerOutput& shaker, RetryDelay retry = {},
              const OutputChecks& output_checks = {});
  ~BenchDriver() override;

  /// The first time all devices must be attached; later, gauges may be reopened in the background.
  Result open() override;
  Result start() override;
  Result read(Frame& frame) override;
  Result write(const Actuation& actuation) override;
  void stop() noexcept override;
  void close() noexcept override;
  const Description& description() const override { return description_; }
  /// An output that differs from what is read back is known to the thread that reads only.
  Signals signals() const noexcept override;
  std::array<std::int32_t, channel_count> age_sigma_us() const noexcept override;
  OutputReadings output_readings() const noexcept override { return outputs_; }
  const char* left_on() const noexcept override;
  /// The counts of the board, the restarts of the estimate of its clock, and the losses of each
  /// gauge.
  Counts counts() const noexcept override;

 private:
  struct Wire {
    Channel channel = Channel::displacement;
    std::size_t gauge = 0;
    std::size_t input = 0;
  };
  void connect(const config::BenchInputs& inputs);
  bool connect(Channel channel, const config::BenchInput& wanted);
  void describe();
  void switch_contact_off() noexcept;
  Result next_scan(Frame& scan);
  Result read_board(Frame& scan);
  void check_outputs(const Frame& scan);
  std::int32_t sigma_of_age_us(std::int64_t reading_sigma_ns) const;
  double volts_of(double drive) const;

  std::unique_ptr<HostClock> clock_;  // outlives the devices
  std::unique_ptr<Driver> board_;
  std::vector<std::unique_ptr<GaugeReader>> gauges_;
  std::vector<Wire> wires_;
  std::unique_ptr<Contacts> amplifier_;
  config::ShakerOutput shaker_;
  bool board_has_clock_;
  StreamClock stream_clock_;
  std::atomic<std::uint64_t> clock_restarts_{0};
  Description description_;
  std::string unmatched_;  // message about inputs that no device has
  bool contact_on_ = false;
  std::string left_on_;  // message about the contact; empty: it is off
  bool opened_before_ = false;
  // Of the latest frame; other threads read them for display.
  std::array<std::atomic<std::int32_t>, channel_count> age_sigma_us_{};
  OutputChecks output_checks_;
  OutputReadings outputs_;  // of the latest frame
  // Of scans whose time is not known yet, by sequence.
  struct SequencedOutputs {
    std::uint64_t sequence = 0;
    OutputReadings outputs;
  };
  std::vector<SequencedOutputs> held_outputs_;
};

}  // namespace stickslip::drivers
