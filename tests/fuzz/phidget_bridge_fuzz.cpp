// SPDX-License-Identifier: Apache-2.0
// Arbitrary bytes from a PhidgetBridge: as reports, rejected or with valid settings, and not used
// before the settings were echoed twice; as a report descriptor, with a length that can be sent.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>

#include "drivers/phidget_bridge/protocol.h"

namespace {

using namespace stickslip::drivers::phidget_bridge;

void require(bool holds, const char* what) {
  if (!holds) throw std::logic_error(what);
}

/// Valid settings from four bytes.
Settings settings_of(const std::uint8_t* bytes) {
  constexpr int gains[] = {1, 8, 16, 32, 64, 128};
  Settings settings;
  for (unsigned i = 0; i < input_count; ++i) {
    settings.enabled[i] = (bytes[0] >> i & 1U) != 0;
    settings.gain[i] = gains[(bytes[1 + i / 2] >> (i % 2 * 4U) & 0x0FU) % 6U];
  }
  settings.interval_ms = 8 * std::clamp<int>(bytes[3], 1, 125);
  return settings;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 4) return 0;
  const Settings wanted = settings_of(data);
  std::span<const std::uint8_t> bytes(data + 4, size - 4);
  require(output_report_bytes(bytes) <= 4096, "an output report has a length that can be sent");
  Handshake handshake(wanted, data[0] % 2 == 0 ? 101 : 102);
  GapCounter gaps(std::int64_t{wanted.interval_ms} * 1'000'000);
  std::int64_t time_ns = 0;
  int echoes = 0;
  while (!bytes.empty()) {
    handshake.to_send();
    const auto piece = bytes.first(std::min(input_bytes, bytes.size()));
    bytes = bytes.subspan(piece.size());
    time_ns += std::int64_t{piece[0]} * 1'000'000;
    require(gaps.count(time_ns, 1) < 64, "no more is missing than there was time for");
    const auto report = parse_input(piece);
    if (!report) continue;
    const bool confirms =
        report->settings.enabled == wanted.enabled && report->settings.gain == wanted.gain;
    if (confirms) ++echoes;
    handshake.take(*report);
    if (!handshake.done()) continue;
    require(echoes >= 2 && confirms, "valid reports have the requested inputs and gains");
    for (std::size_t i = 0; i < input_count; ++i) {
      const int gain = report->settings.gain[i];
      require(is_gain(gain), "a gain exists");
      const double value = ratio(report->raw[i], gain);
      require(std::abs(value) * gain <= 1.0, "a ratio is within the range");
      require(!is_valid(*report, i) || report->measured[i], "what was not measured is none");
    }
  }
  return 0;
}
