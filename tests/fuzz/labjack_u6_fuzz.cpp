// SPDX-License-Identifier: Apache-2.0
// Arbitrary bytes from a LabJack U6. The first three are the number of channels of a scan, the
// samples per packet, and a flag (bit 0) to correct the checksums, which reaches the code behind
// them; the rest are stream packets, and again a reply to each command.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <vector>

#include "drivers/labjack_u6/protocol.h"
#include "drivers/labjack_u6/stream_decoder.h"

namespace {

namespace u6 = stickslip::drivers::labjack_u6;
using Bytes = std::vector<std::uint8_t>;

void require(bool holds, const char* what) {
  if (!holds) throw std::logic_error(what);
}

void set_checksums(Bytes& bytes) {
  if (bytes.size() < 6) return;
  const std::uint16_t sum = u6::checksum16(std::span(bytes).subspan(6));
  bytes[4] = static_cast<std::uint8_t>(sum & 0xFFU);
  bytes[5] = static_cast<std::uint8_t>(sum >> 8U);
  bytes[0] = u6::checksum8(std::span(bytes).subspan(1, 5));
}

void decode(int channels, int samples, bool right, std::span<const std::uint8_t> rest) {
  u6::StreamDecoder decoder(channels, samples);
  std::uint64_t next = 0;
  std::uint64_t scans = 0;
  bool over = false;
  while (!rest.empty()) {
    const std::size_t size = std::min(rest.size(), decoder.packet_bytes());
    Bytes packet(rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(size));
    rest = rest.subspan(size);
    if (right && size == decoder.packet_bytes()) {
      packet[1] = 0xF9;
      packet[2] = static_cast<std::uint8_t>(4 + samples);
      packet[3] = 0xC0;
      set_checksums(packet);
    }
    const auto outcome = decoder.take(packet);
    using Outcome = u6::StreamDecoder::Outcome;
    require(!over || outcome == Outcome::uncountable,
            "a stream with an unknown number of lost scans ends");
    over = outcome == Outcome::uncountable;
    require(outcome == Outcome::ok || decoder.scans().empty(), "only valid packets yield scans");
    require(decoder.scans().size() <= 25, "a packet completes no more scans than it has samples");
    for (const u6::Scan& scan : decoder.scans()) {
      require(scan.index >= next, "scans are in order");
      next = scan.index + 1;
      ++scans;
    }
  }
  require(decoder.counts().scans == scans, "every scan is counted");
  require(decoder.counts().scans + decoder.counts().scans_lost == next, "so is every lost one");
}

void parse(Bytes reply, bool right) {
  if (right) set_checksums(reply);
  u6::Identity identity;
  if (u6::parse_identity(reply, identity)) {
    require(reply.size() == 38, "an identity has 38 bytes");
    require(u6::name_of(identity).size() < 40, "a board has a short name");
  }
  u6::CalibrationBlock block{};
  if (u6::parse_calibration(reply, block)) {
    std::array<u6::CalibrationBlock, u6::calibration_blocks> blocks;
    blocks.fill(block);
    const u6::Calibration calibration = u6::calibration_of(blocks);
    require(u6::implausible_constant(calibration).size() < 200, "the message is short");
    require(std::isfinite(u6::volts(calibration, 3, 65535)), "volts are finite");
    static_cast<void>(u6::dac_counts(calibration, 1, 2.5));
  }
  for (const bool lines : {true, false}) {
    u6::FeedbackReply feedback;
    if (u6::parse_feedback(reply, lines, feedback)) {
      require(feedback.lines <= 0xFFFFFF, "lines are three bytes");
    }
  }
  for (const auto check :
       {u6::check_plain_lines, u6::check_stream_configured, u6::check_stream_started,
        u6::check_stream_stopped, u6::check_watchdog}) {
    require(!u6::in_words(check(reply)).empty(), "every verdict has a text");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 3) return 0;
  const std::span<const std::uint8_t> rest(data + 3, size - 3);
  const bool right = (data[2] & 1U) != 0;
  decode(1 + data[0] % 25, 1 + data[1] % 25, right, rest);
  parse(Bytes(rest.begin(), rest.end()), right);
  return 0;
}
