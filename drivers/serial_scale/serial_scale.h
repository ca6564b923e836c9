// A balance on a serial line that writes its weight by itself, about ten times a second:
//   S +00012.345 g *30\r\n
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/bench.h"
#include "drivers/gauge.h"
#include "drivers/host_clock.h"
#include "drivers/rhythm.h"
#include "drivers/serial_line.h"

namespace stickslip::drivers {

namespace serial_scale {

/// What one line says.
struct Weight {
  double force_n = 0.0;  ///< at standard gravity
  bool valid = false;    ///< false: the balance says that it is in error
};

/// Of a whole line, its "\r\n" included. Nothing where its form or its checksum is not right. The
/// checksum sees whatever befalls one byte, or eight bits in a row; two digits that change places,
/// or have the same bit turned, it cannot see.
std::optional<Weight> parse_line(std::string_view line);

}  // namespace serial_scale

/// Input "weight" in N. A reading's time is that at which its line began, by when its end was there
/// and by the baud rate; of lines that come together the newest counts. Readings in motion are
/// valid, those of a balance in error are not. The first line after open may have been cut, and is
/// then one that is rejected. A balance that is silent is not lost: its lines are missing.
class SerialScale final : public Gauge {
 public:
  /// `inputs` holds those of this balance alone. `clock` must outlive the gauge.
  SerialScale(const config::GaugeAt& settings, const config::BenchInputs& inputs, HostClock& clock);

  const std::string& name() const override { return name_; }
  std::span<const GaugeInput> inputs() const override { return inputs_; }
  /// Does not wait for a line. No other program can open the port from then on.
  Result open() override;
  Result read(std::span<Reading> readings) override;
  void close() noexcept override { line_.close(); }
  GaugeLosses losses() const override { return losses_; }

 private:
  Result tell(Outcome outcome, const std::string& words);
  Result take_lines(std::span<Reading> readings);

  config::GaugeAt settings_;
  std::string name_;
  std::vector<GaugeInput> inputs_;
  HostClock& clock_;
  SerialLine line_;
  std::string received_;  // of which nothing is told yet
  Rhythm rhythm_;
  GaugeLosses losses_;
  std::string message_;
};

}  // namespace stickslip::drivers
