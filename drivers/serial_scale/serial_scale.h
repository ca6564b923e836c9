// SPDX-License-Identifier: Apache-2.0
// A balance on a serial line that transmits weights unrequested, about ten times a second:
//   S +00012.345 g *30\r\n
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/bench.h"
#include "drivers/clock/arrival_scatter.h"
#include "drivers/clock/host_clock.h"
#include "drivers/clock/missed_messages.h"
#include "drivers/gauge.h"
#include "drivers/serial/serial_line.h"

namespace stickslip::drivers {

namespace serial_scale {

/// Content of a line.
struct Weight {
  double force_n = 0.0;  ///< at standard gravity
  bool valid = false;    ///< false: the balance reports an error
};

/// Parses a complete line, including "\r\n". None for a wrong format or checksum. The checksum
/// detects errors in one byte or in eight consecutive bits, but not two exchanged digits or the
/// same bit inverted in both.
std::optional<Weight> parse_line(std::string_view line);

}  // namespace serial_scale

/// Input "weight" in N. The time of a reading is the start of its line, from its arrival and the
/// baud rate; of lines that arrive together the newest is used. Readings in motion are valid, those
/// of a balance in error are not. The first line after open may be truncated, and then counts as
/// rejected. A silent balance is not lost: its lines count as missing.
class SerialScale final : public Gauge {
 public:
  /// `inputs` are those of this balance only. `clock` must outlive the gauge.
  SerialScale(const config::GaugeAt& settings, const config::BenchInputs& inputs, HostClock& clock);

  const std::string& name() const override { return name_; }
  std::span<const GaugeInput> inputs() const override { return inputs_; }
  /// Does not wait for a line. Excludes other programs from the port.
  Result open() override;
  Result read(std::span<Reading> readings) override;
  void close() noexcept override { line_.close(); }
  GaugeLosses losses() const override { return losses_; }

 private:
  Result report(Outcome outcome, const std::string& text);
  Result take_lines(std::span<Reading> readings);

  config::GaugeAt settings_;
  std::string name_;
  std::vector<GaugeInput> inputs_;
  HostClock& clock_;
  SerialLine line_;
  std::string received_;  // not yet parsed
  MissedMessages missed_messages_;
  ArrivalScatter arrivals_{100'000'000};  // begun anew by open
  GaugeLosses losses_;
  std::string message_;
};

}  // namespace stickslip::drivers
