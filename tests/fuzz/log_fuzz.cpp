// SPDX-License-Identifier: Apache-2.0
// Any bytes as an LCM event log: refused in one line with the byte, or read into valid frames;
// surveyed to the end; and repaired into a readable log.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

#include "physics/problem.h"
#include "protocol/recording_log.h"
#include "protocol/recording_survey.h"

namespace {

void require(bool holds, const char* what) {
  if (!holds) throw std::logic_error(what);
}

void append_big_endian(std::string& bytes, std::uint64_t value, int size) {
  for (int shift = 8 * (size - 1); shift >= 0; shift -= 8) {
    bytes += static_cast<char>(value >> static_cast<unsigned>(shift));
  }
}

/// An event as written by LogWriter.
void append(std::string& log, const stickslip::protocol::LogEvent& event, std::uint64_t number) {
  log += stickslip::protocol::sync_word;
  append_big_endian(log, number, 8);
  append_big_endian(log, static_cast<std::uint64_t>(event.time_us), 8);
  append_big_endian(log, event.channel.size(), 4);
  append_big_endian(log, event.data.size(), 4);
  log += event.channel;
  log.append(event.data.begin(), event.data.end());
}

void survey_and_repair(const std::string& bytes) {
  using namespace stickslip;
  std::istringstream in(bytes);
  const protocol::LogSurvey survey = protocol::survey_log(in, "fuzz.log");
  require(survey.damaged_bytes + survey.cut_off_bytes <= survey.bytes, "no byte is damaged twice");
  std::string repaired;
  std::uint64_t events = 0;
  const protocol::RepairResult repair = protocol::repair_log(
      in, "fuzz.log", [&](const protocol::LogEvent& event) { append(repaired, event, events++); });
  require(repair.events == events && events <= survey.events, "kept events are intact");
  require(repaired.size() <= bytes.size(), "nothing is added");
  std::istringstream again(repaired);
  const protocol::LogSurvey after = protocol::survey_log(again, "fuzz.log");
  require(after.events == events && after.frames == repair.frames, "all kept events are written");
  require(after.damaged_places + after.bad_checksums + after.undecodable + after.misnumbered == 0 &&
              after.cut_off_bytes == 0 && after.times_back == 0,
          "a repaired log is intact");
  try {
    const auto frames = protocol::parse_log(again, "fuzz.log").frames.size();
    require(frames == repair.frames, "a repaired log is readable");
  } catch (const InputError& error) {
    require(std::string_view(error.what()).find(" has no ") != std::string_view::npos,
            "a repaired log is readable, or has no frames");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stickslip;
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  survey_and_repair(bytes);
  std::istringstream in(bytes);
  protocol::Recording recording;
  try {
    recording = protocol::parse_log(in, "fuzz.log");
  } catch (const InputError& error) {
    const std::string_view line = error.what();
    require(line.starts_with("fuzz.log: ") && line.size() < 1000,
            "a refusal names its file, briefly");
    require(line.find("at byte ") != line.npos || line.find("has no frames") != line.npos,
            "a refusal has its place");
    return 0;
  }
  require(recording.cut_off_bytes <= size, "the incomplete bytes are within the file");
  require(!recording.frames.empty(), "a recording holds frames");
  for (std::size_t i = 0; i < recording.frames.size(); ++i) {
    const Frame& frame = recording.frames[i];
    require(i == 0 || frame.time_ns > recording.frames[i - 1].time_ns, "time increases");
    for (const Channel channel : all_channels) {
      require(std::isfinite(frame[channel]), "values are finite");
      require(frame.has(channel) || frame[channel] == 0.0, "values that are not measured are 0");
    }
  }
  return 0;
}
