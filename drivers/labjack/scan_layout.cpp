// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack/scan_layout.h"

#include <utility>

namespace stickslip::drivers::labjack {

void ScanLayout::convert(const ConverterCalibration& calibration,
                         std::span<const std::uint16_t> counts, Frame& frame,
                         OutputReadings& outputs) const {
  const auto volts_at = [&](std::size_t i) { return volts(calibration, scan[i].gain, counts[i]); };
  for (std::size_t i = 0; i < channel.size(); ++i) frame.set(channel[i], volts_at(i));
  if (drive_readback) outputs.drive_v = volts_at(*drive_readback);
  if (enable_readback) outputs.enable_v = volts_at(*enable_readback);
}

ScanLayout layout_of(const config::BenchInputs& inputs, const config::LabjackOutput& output) {
  ScanLayout layout;
  const auto add = [&layout](const config::BenchInput& input) {
    layout.scan.push_back({input_named(input.input).value_or(0), input.differential,
                           gain_of(input.range_v).value_or(0)});
    return layout.scan.size() - 1;
  };
  for (const Channel channel : all_channels) {
    const auto& input = inputs[index_of(channel)];
    if (!input) continue;
    add(*input);
    layout.channel.push_back(channel);
  }
  if (output.drive_readback) layout.drive_readback = add(*output.drive_readback);
  if (output.enable_readback) layout.enable_readback = add(*output.enable_readback);
  return layout;
}

std::string inputs_error(const std::string& board, const config::BenchInputs& inputs,
                         const config::LabjackOutput& output, std::size_t& count) {
  count = 0;
  for (const Channel channel : all_channels) {
    const auto& input = inputs[index_of(channel)];
    if (!input) continue;
    ++count;
    const std::string table = "inputs." + std::string(info(channel).stem);
    if (std::string error = input_error(table, board, *input); !error.empty()) return error;
  }
  if (count == 0) {
    return "no channel is assigned to " + board +
           ": its scans pace the loop, so [inputs] must use at least one of AIN0 to AIN13";
  }
  for (const auto& [table, input] : {std::pair("readback.drive", &output.drive_readback),
                                     std::pair("readback.enable", &output.enable_readback)}) {
    if (!*input) continue;
    ++count;
    if (std::string error = input_error(table, board, **input); !error.empty()) return error;
  }
  return {};
}

}  // namespace stickslip::drivers::labjack
