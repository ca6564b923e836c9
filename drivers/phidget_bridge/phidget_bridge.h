// SPDX-License-Identifier: Apache-2.0
// PhidgetBridge 4-Input 1046: four strain-gauge bridges, 24 bits, up to 125 readings per second.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/attached_device.h"
#include "drivers/clock/host_clock.h"
#include "drivers/gauge.h"

namespace stickslip::drivers {

namespace phidget_bridge {
struct Settings;
}  // namespace phidget_bridge

/// Inputs "0" to "3" in V/V: bridge output over supply. The board has neither clock nor sequence
/// numbers: the time of a reading is its arrival (readings that arrive together have the time of
/// the last), and missing ones are counted by the interval that the board states. A reading that
/// the board reports as out of range, or beyond 0.995 of the range, is invalid; so is that of an
/// input not measured for more than two intervals. Until then the last reading is kept, with its
/// time.
class PhidgetBridge final : public Gauge {
 public:
  /// `inputs` are those on this board only, in the order of their channels.
  /// `clock` must outlive the gauge.
  PhidgetBridge(const config::PhidgetBridge& settings, const config::BenchInputs& inputs,
                HostClock& clock);
  ~PhidgetBridge() override;

  const std::string& name() const override { return name_; }
  std::span<const GaugeInput> inputs() const override { return inputs_; }
  /// Sends the settings and waits until the board's reports confirm them, at most 3 s plus five
  /// intervals. After the first open only the same board is accepted, also without a configured
  /// serial number.
  Result open() override;
  Result read(std::span<Reading> readings) override;
  void close() noexcept override;
  GaugeLosses losses() const override { return losses_; }
  std::string remark() const override;

 private:
  struct Board;
  Result check();
  phidget_bridge::Settings wanted_settings() const;
  Result settle();
  Result send();
  Result gone();
  bool publish(std::span<Reading> readings, std::int64_t now);

  config::PhidgetBridge settings_;
  config::BenchInputs wired_;
  HostClock& clock_;
  std::string name_ = "PhidgetBridge 1046";
  std::string serial_at_start_;  // empty: none was opened yet, or its number is unknown
  std::vector<GaugeInput> inputs_;
  std::vector<std::size_t> numbers_;  // input numbers of the board, by inputs_
  GaugeLosses losses_;
  std::string refusal_;
  std::unique_ptr<Board> board_;
};

/// Every attached board of this kind, including unsupported versions.
std::vector<AttachedDevice> find_phidget_bridge();

}  // namespace stickslip::drivers
