// SPDX-License-Identifier: Apache-2.0
// A Modbus unit as a gauge: the registers of its map are polled, checked and scaled.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/clock/host_clock.h"
#include "drivers/gauge.h"
#include "drivers/modbus/modbus_bus.h"
#include "drivers/modbus/plan.h"

namespace stickslip::drivers {

/// A poll sends all requests of the plan, one after the other, every poll_period_s. Its readings
/// are returned together; the time of each is midway between its request and reply.
///
/// - A status register that is not `ok` invalidates the readings of the poll. The first such poll
///   returns `temporary` with a message; later ones are ok, with invalid readings.
/// - An alarm register that is not `ok` is an amplifier_fault. So is an unknown one: before open,
///   after close, when the unit is lost, and after five consecutive failed polls.
/// - Settings are read on open. One with a different value is written and read back: only then, as
///   units keep settings in memory that wears out. If it still differs, it needs attention and is
///   not written again until it holds another value or the unit was disconnected.
/// - No reply: temporary, and after `retries` more attempts lost. Exceptions 1, 2, 3 and 10 need
///   attention, others are temporary.
class ModbusUnit final : public Gauge {
 public:
  /// `inputs` are names of registers of role `reading`.
  ModbusUnit(config::ModbusUnit settings, std::vector<std::string> inputs,
             std::shared_ptr<modbus::ModbusBus> bus, HostClock& clock);
  ~ModbusUnit() override;

  const std::string& name() const override { return name_; }
  std::span<const GaugeInput> inputs() const override { return inputs_; }
  Result open() override;
  Result read(std::span<Reading> readings) override;
  void close() noexcept override;
  GaugeLosses losses() const override { return losses_; }
  Signals signals() const noexcept override;

 private:
  struct Answered {
    std::vector<std::uint16_t> words;
    std::int64_t time_ns = 0;   // midway between request and reply
    std::int64_t sigma_ns = 0;  // of a measurement at any time between them
  };

  Result report(Outcome outcome, std::string text);
  Result check_map();
  Result open_all();
  Result apply_setting(std::size_t at);
  Result request_with_retries(std::span<const std::uint8_t> request, const std::string& what,
                              std::vector<std::uint16_t>& words, int retries);
  Result failed(const modbus::Exchange& exchange, const std::string& what);
  Result silent(const std::string& what);
  Result garbled(const modbus::Exchange& exchange, const std::string& what);
  Result refused(std::uint8_t exception, const std::string& what);
  Result poll_until(std::int64_t until_ns, bool& complete);
  Result take(std::span<Reading> readings);
  void set_alarm_unknown() noexcept;
  void abandon_poll();
  void next_poll();
  std::span<const std::uint16_t> words_of(std::size_t at) const;
  std::string names_in(std::size_t request) const;
  /// Message about the first register of a role that is not ok; empty if all are.
  std::string fault_of(config::RegisterRole role) const;

  config::ModbusUnit settings_;
  std::string name_;
  std::vector<GaugeInput> inputs_;
  std::vector<std::optional<std::size_t>> input_registers_;  // indices in the map, by input
  std::shared_ptr<modbus::ModbusBus> bus_;
  HostClock& clock_;
  modbus::Caller caller_;
  modbus::Plan plan_;
  bool has_alarm_ = false;
  std::map<std::size_t, std::vector<std::uint16_t>> rejected_;  // settings: the value read back

  bool open_ = false;
  std::vector<Answered> answered_;  // replies of the current poll, by request
  std::int64_t due_ns_ = 0;
  int consecutive_timeouts_ = 0;
  int consecutive_invalid_replies_ = 0;
  int consecutive_failed_polls_ = 0;
  bool status_was_ok_ = true;
  GaugeLosses losses_;
  std::string message_;
  std::atomic<bool> alarm_;
};

/// One gauge for each unit that an input of `inputs` comes from (its `device` is the unit's name),
/// or whose map has an alarm, a status or a setting. Units on the same port, or the same host and
/// port, share their bus. `clock` has to outlive them.
std::vector<std::unique_ptr<Gauge>> make_modbus_gauges(const std::vector<config::ModbusUnit>& units,
                                                       const config::BenchInputs& inputs,
                                                       HostClock& clock);

}  // namespace stickslip::drivers
