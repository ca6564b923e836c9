// PhidgetBridge 4-Input 1046: four bridges of strain gauges, 24 bits, up to 125 readings a second.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/attached.h"
#include "drivers/gauge.h"
#include "drivers/host_clock.h"

namespace stickslip::drivers {

/// Inputs "0" to "3" in V/V: the bridge's output over its supply. The board has no clock and no
/// numbers: a reading's time is that of its arrival (readings that arrive together have the time of
/// the last), and what is missing shows by the interval. A reading of an input that the board calls
/// out of range, or that is beyond 0.995 of the range, is not valid; nor is one that the board has
/// not measured for more than two intervals. Until then the last one stays, with its time.
class PhidgetBridge final : public Gauge {
 public:
  /// `inputs` holds those of this board alone; they are read in the order of their channels.
  /// `clock` must outlive the gauge.
  PhidgetBridge(const config::PhidgetBridge& settings, const config::BenchInputs& inputs,
                HostClock& clock);
  ~PhidgetBridge() override;

  const std::string& name() const override { return name_; }
  std::span<const GaugeInput> inputs() const override { return inputs_; }
  /// Sends the settings and waits until the board's reports show them, at most 3 s and
  /// five intervals.
  Result open() override;
  Result read(std::span<Reading> readings) override;
  void close() noexcept override;
  GaugeLosses losses() const override { return losses_; }

 private:
  struct Board;
  Result check();
  Result settle();
  Result send();
  Result gone();
  bool tell(std::span<Reading> readings, std::int64_t now);

  config::PhidgetBridge settings_;
  config::BenchInputs wired_;
  HostClock& clock_;
  std::string name_ = "PhidgetBridge 1046";
  std::vector<GaugeInput> inputs_;
  std::vector<std::size_t> numbers_;  // of the board's inputs, as inputs_
  GaugeLosses losses_;
  std::string refusal_;
  std::unique_ptr<Board> board_;
};

/// Every board of this kind on the host, one that this driver does not speak to included.
std::vector<Attached> find_phidget_bridge();

}  // namespace stickslip::drivers
