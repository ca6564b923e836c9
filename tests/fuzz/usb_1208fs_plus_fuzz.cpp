// SPDX-License-Identifier: Apache-2.0
// Arbitrary bytes from a USB-1208FS-Plus: as calibration memory, rejected or plausible; as samples
// in packets of any size, the same scans as in one piece, and voltages within the range.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <vector>

#include "drivers/usb_1208fs_plus/protocol.h"

namespace {

using namespace stickslip::drivers::usb_1208fs_plus;

void require(bool holds, const char* what) {
  if (!holds) throw std::logic_error(what);
}

std::vector<std::uint16_t> decode(std::span<const std::uint8_t> bytes, std::size_t channels,
                                  std::size_t packet) {
  ScanDecoder decoder(channels);
  std::vector<std::uint16_t> codes;
  while (!bytes.empty()) {
    auto piece = bytes.first(std::min(packet, bytes.size()));
    bytes = bytes.subspan(piece.size());
    while (!piece.empty()) {
      const auto scan = decoder.next(piece);
      if (scan) codes.insert(codes.end(), scan->begin(), scan->end());
    }
  }
  return codes;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const std::size_t channels = 1 + data[0] % 8;
  const std::size_t packet = 1 + data[1] % 64;
  const std::span<const std::uint8_t> bytes(data + 2, size - 2);
  const auto codes = decode(bytes, channels, packet);
  require(codes == decode(bytes, channels, bytes.size()), "packets may end anywhere");
  require(codes.size() == bytes.size() / (2 * channels) * channels, "no sample is lost");
  const auto calibration = parse_calibration(bytes);
  for (const std::uint16_t code : codes) {
    require(code < 4096, "a sample has 12 bits");
    if (!calibration) continue;
    const double volts = input_volts(code, 10.0, calibration->single_ended[code % 8]);
    require(std::abs(volts) < 18.0, "a plausible calibration leaves volts near the range");
    require(output_counts(volts) < 4096, "an output has 12 bits");
  }
  return 0;
}
