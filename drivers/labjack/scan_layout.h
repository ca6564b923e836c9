// SPDX-License-Identifier: Apache-2.0
// The scans of a LabJack board: which input is which channel.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/driver.h"
#include "drivers/labjack/converter.h"
#include "physics/frame.h"

namespace stickslip::drivers::labjack {

/// One entry of a scan.
struct StreamChannel {
  std::uint8_t input = 0;  ///< 0 to 13
  bool differential = false;
  std::uint8_t gain = 0;  ///< 0: +-10 V, 1: +-1 V, 2: +-0.1 V, 3: +-0.01 V
};

/// Entries of `scan` and `channel` correspond; further entries of `scan` read the outputs back.
struct ScanLayout {
  std::vector<StreamChannel> scan;             ///< in sampling order
  std::vector<Channel> channel;                ///< the measured quantity
  std::optional<std::size_t> drive_readback;   ///< position in the scan
  std::optional<std::size_t> enable_readback;  ///< position in the scan

  /// Converts the counts of a scan, by position. Sets the channels of `frame`, not its time.
  void convert(const ConverterCalibration& calibration, std::span<const std::uint16_t> counts,
               Frame& frame, OutputReadings& outputs) const;
};

/// Of inputs without an inputs_error.
ScanLayout layout_of(const config::BenchInputs& inputs, const config::LabjackOutput& output);

/// The first input that the board does not have; empty if all are valid. `board`: its name in the
/// configuration. `count`: entries of a scan.
std::string inputs_error(const std::string& board, const config::BenchInputs& inputs,
                         const config::LabjackOutput& output, std::size_t& count);

}  // namespace stickslip::drivers::labjack
