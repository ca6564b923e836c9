// SPDX-License-Identifier: Apache-2.0
// Any bytes as a CSV recording: refused in one printable line, or read into valid frames that
// survive writing and reading.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include "physics/problem.h"
#include "protocol/recording.h"

namespace {

void require(bool holds, const char* what) {
  if (!holds) throw std::logic_error(what);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stickslip;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  protocol::Recording recording;
  try {
    recording = protocol::parse_csv(text, "fuzz.csv");
  } catch (const InputError& error) {
    const std::string_view line = error.what();
    require(line.starts_with("fuzz.csv") && line.size() < 1000,
            "a refusal names its file, briefly");
    for (const char c : line) {
      require(static_cast<unsigned char>(c) >= 0x20, "a refusal is one line of text");
    }
    return 0;
  }
  require(!recording.frames.empty(), "a recording holds frames");
  for (std::size_t i = 0; i < recording.frames.size(); ++i) {
    const Frame& frame = recording.frames[i];
    require(frame.sequence == i, "sequence numbers count from 0");
    require(i == 0 || frame.time_ns > recording.frames[i - 1].time_ns, "time increases");
    for (const Channel channel : all_channels) {
      require(std::isfinite(frame[channel]), "values are finite");
      require(frame.has(channel) || frame[channel] == 0.0, "values that are not measured are 0");
    }
  }
  // A column of empty cells is read, but not written.
  if (recording.channels == 0) return 0;
  std::ostringstream out;
  protocol::write_csv(recording, out);
  const protocol::Recording again = protocol::parse_csv(out.str(), "again.csv");
  require(again.frames == recording.frames, "written frames read back");
  return 0;
}
