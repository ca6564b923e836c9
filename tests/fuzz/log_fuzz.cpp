// Any bytes as an LCM event log: refused in one line that says at which byte, or read into frames
// that hold what frames promise.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

#include "physics/problem.h"
#include "protocol/recording_log.h"

namespace {

void require(bool holds, const char* what) {
  if (!holds) throw std::logic_error(what);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stickslip;
  std::istringstream in(std::string(reinterpret_cast<const char*>(data), size));
  protocol::Recording recording;
  try {
    recording = protocol::parse_log(in, "fuzz.log");
  } catch (const InputError& error) {
    const std::string_view line = error.what();
    require(line.starts_with("fuzz.log: ") && line.size() < 1000,
            "a refusal names its file, briefly");
    require(line.find("at byte ") != line.npos || line.find("holds no frames") != line.npos,
            "a refusal says where");
    return 0;
  }
  require(!recording.frames.empty(), "a recording holds frames");
  for (std::size_t i = 0; i < recording.frames.size(); ++i) {
    const Frame& frame = recording.frames[i];
    require(i == 0 || frame.time_ns > recording.frames[i - 1].time_ns, "time increases");
    for (const Channel channel : all_channels) {
      require(std::isfinite(frame[channel]), "values are finite");
      require(frame.has(channel) || frame[channel] == 0.0, "what is not measured is 0");
    }
  }
  return 0;
}
