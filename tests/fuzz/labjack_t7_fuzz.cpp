// SPDX-License-Identifier: Apache-2.0
// Arbitrary bytes from a LabJack T7. The first three are the number of channels of a scan, half of
// the samples per packet, and the size of the pieces in which the rest arrives from the network:
// messages that are packets of a stream, and again replies.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>

#include "drivers/labjack_t7/protocol.h"
#include "drivers/labjack_t7/stream_decoder.h"

namespace {

namespace t7 = stickslip::drivers::labjack_t7;
using Bytes = std::span<const std::uint8_t>;

void require(bool holds, const char* what) {
  if (!holds) throw std::logic_error(what);
}

/// Decodes packets and checks their scans.
class Stream {
 public:
  Stream(int channels, int samples) : decoder_(channels, samples) {}

  void take(const t7::StreamPacket& packet) {
    using Outcome = t7::StreamDecoder::Outcome;
    const Outcome outcome = decoder_.take(packet);
    require(!over_ || outcome == Outcome::uncountable,
            "a stream with an unknown number of lost scans ends");
    over_ = outcome == Outcome::uncountable;
    require(outcome == Outcome::ok || decoder_.scans().empty(), "only valid packets yield scans");
    for (const t7::Scan& scan : decoder_.scans()) {
      require(scan.index >= next_, "scans are in order");
      next_ = scan.index + 1;
      ++scans_;
    }
    require(decoder_.counts().scans == scans_, "every scan is counted");
    require(decoder_.counts().scans + decoder_.counts().scans_lost == next_, "so is a lost one");
  }

 private:
  t7::StreamDecoder decoder_;
  std::uint64_t next_ = 0;
  std::uint64_t scans_ = 0;
  bool over_ = false;
};

void parse(Bytes message) {
  for (const std::size_t expected : {0U, 2U, 4U, 12U, 32U}) {
    Bytes data;
    const t7::Verdict verdict = t7::parse_reply(message, expected, data);
    require(!t7::in_words(verdict).empty(), "every verdict has a text");
    require(t7::unpacked(t7::packed(verdict)).code == verdict.code, "a verdict fits a word");
    if (!verdict) continue;
    require(data.size() == expected, "a reply has the data that were asked for");
    if (expected == 12) require(t7::firmware_of(t7::identity_of(data)).size() < 64, "short");
    if (expected != 32) continue;
    stickslip::drivers::labjack::ConverterCalibration calibration;
    t7::add_constants(calibration, 0, data);
    t7::add_constants(calibration, 1, data);
    if (!implausible_constant(calibration).empty()) continue;
    require(std::isfinite(volts(calibration, 3, 65535)), "volts are finite");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 3) return 0;
  Stream stream(1 + data[0] % t7::max_channels, 1 + 2 * data[1]);
  const std::size_t piece = 1U + data[2];
  t7::MessageReader reader;
  for (Bytes rest(data + 3, size - 3); !rest.empty();) {
    const std::span<std::uint8_t> space = reader.space();
    const std::size_t moved = std::min({piece, rest.size(), space.size()});
    require(moved > 0, "there is space for the rest of a message");
    std::copy_n(rest.begin(), moved, space.begin());
    reader.received(moved);
    rest = rest.subspan(moved);
    Bytes message;
    t7::MessageReader::Next next = reader.next(message);
    for (; next == t7::MessageReader::Next::message; next = reader.next(message)) {
      parse(message);
      if (const auto packet = t7::parse_packet(message)) stream.take(*packet);
    }
    if (next == t7::MessageReader::Next::garbled) return 0;
  }
  return 0;
}
