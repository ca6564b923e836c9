// SPDX-License-Identifier: Apache-2.0
#include "drivers/factory/make_bench.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "drivers/amplifier/amplifier.h"
#include "drivers/bench/bench_driver.h"
#include "drivers/labjack_t7/labjack_t7_driver.h"
#include "drivers/labjack_u6/labjack_u6_driver.h"
#include "drivers/modbus/modbus_unit.h"
#include "drivers/phidget_bridge/phidget_bridge.h"
#include "drivers/serial_scale/serial_scale.h"
#include "drivers/usb_1208fs_plus/usb_1208fs_plus_driver.h"

namespace stickslip::drivers {

namespace {

/// With the inputs that read the outputs back.
template <class Settings>
Settings with_readback(Settings settings, const config::Readback& readback) {
  if (readback.drive) settings.drive_readback = readback.drive->input;
  if (readback.enable) settings.enable_readback = readback.enable->input;
  return settings;
}

/// A kind without a case does not compile.
std::unique_ptr<Driver> board_of(const config::Bench& bench, double rate_hz, HostClock& clock) {
  const config::BenchInputs inputs =
      config::inputs_of(bench.inputs, std::string(config::name_of(bench.board)));
  switch (bench.board) {
    case config::BoardKind::labjack_u6:
      return std::make_unique<LabjackU6Driver>(with_readback(bench.labjack_u6, bench.readback),
                                               inputs, rate_hz, clock);
    case config::BoardKind::labjack_t7:
      return std::make_unique<LabjackT7Driver>(with_readback(bench.labjack_t7, bench.readback),
                                               inputs, rate_hz, clock);
    case config::BoardKind::usb_1208fs_plus:
      return std::make_unique<Usb1208fsPlusDriver>(
          with_readback(bench.usb_1208fs_plus, bench.readback), inputs, rate_hz, clock);
  }
  throw std::logic_error("unknown kind of board");
}

bool any(const config::BenchInputs& inputs) {
  return std::any_of(inputs.begin(), inputs.end(), [](const auto& input) { return !!input; });
}

/// `inputs` are those of this gauge. A kind without a case does not compile.
std::unique_ptr<Gauge> gauge_of(const config::GaugeAt& settings, const config::BenchInputs& inputs,
                                HostClock& clock) {
  switch (settings.kind) {
    case config::GaugeKind::serial_scale:
      return std::make_unique<SerialScale>(settings, inputs, clock);
  }
  throw std::logic_error("unknown kind of gauge");
}

}  // namespace

BenchParts make_bench_parts(const config::Bench& bench, double rate_hz) {
  BenchParts parts;
  parts.clock = std::make_unique<MonotonicHostClock>();
  HostClock& clock = *parts.clock;
  parts.board = board_of(bench, rate_hz, clock);
  parts.gauges = make_modbus_gauges(bench.modbus, bench.inputs, clock);
  const config::BenchInputs bridge = config::inputs_of(bench.inputs, "phidget_bridge");
  if (any(bridge)) {
    parts.gauges.push_back(std::make_unique<PhidgetBridge>(bench.phidget_bridge, bridge, clock));
  }
  for (const config::GaugeAt& gauge : bench.gauges) {
    const config::BenchInputs own = config::inputs_of(bench.inputs, gauge.name);
    if (any(own)) parts.gauges.push_back(gauge_of(gauge, own, clock));
  }
  if (bench.amplifier) parts.amplifier = std::make_unique<Amplifier>(*bench.amplifier, clock);
  return parts;
}

std::unique_ptr<Driver> make_bench(const config::Bench& bench, double rate_hz) {
  return std::make_unique<BenchDriver>(make_bench_parts(bench, rate_hz), bench.inputs, bench.shaker,
                                       RetryDelay{}, OutputChecks(bench, rate_hz));
}

}  // namespace stickslip::drivers
