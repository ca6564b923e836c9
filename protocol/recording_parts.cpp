// SPDX-License-Identifier: Apache-2.0
#include "protocol/recording_parts.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <utility>
#include <vector>

#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/recording.h"
#include "protocol/recording_log.h"

namespace stickslip::protocol {
namespace {

std::string named(const LogSurvey& part) {
  return part.source + " (part " + std::to_string(part.part()) + ")";
}

[[noreturn]] void refuse(const std::string& name, const std::string& message) {
  throw InputError(Problem{name, 0, 0, message});
}

/// The parts by number, all intact and of one recording.
std::vector<LogSurvey> parts_of(std::span<const std::filesystem::path> files,
                                const ProgressCallback& done) {
  std::vector<LogSurvey> parts;
  for (const auto& file : files) {
    parts.push_back(survey_log(file, progress_of_part(done, parts.size(), 2 * files.size())));
    if (!parts.back().info) {
      refuse(file.string(), "does not begin with its description: its recording is unknown");
    }
    if (!of_one_recording(*parts.front().info, *parts.back().info)) {
      refuse(file.string(), "belongs to another recording than " + parts.front().source);
    }
  }
  std::sort(parts.begin(), parts.end(),
            [](const LogSurvey& a, const LogSurvey& b) { return a.part() < b.part(); });
  for (LogSurvey& part : parts) {
    LogSurvey whole = part;
    if (&part == &parts.back()) whole.cut_off_bytes = 0;
    const std::vector<std::string> faults = whole.faults();
    if (!faults.empty()) {
      refuse(part.source, faults.front() + "; `stickslip log repair` keeps the intact events");
    }
  }
  const std::vector<std::string> faults = faults_between(parts);
  if (!faults.empty()) throw InputError(Problem{"", 0, 0, faults.front()});
  return parts;
}

/// Makes the description after a change of the model one of a part, `first`.
void take_over_part(const recording_info_t& first, std::vector<std::uint8_t>& message) {
  recording_info_t info;
  if (!decode(message, info)) return;  // the survey accepted it
  info.part = first.part;
  info.previous_part = first.previous_part;
  info.frames_before = first.frames_before;
  message.resize(static_cast<std::size_t>(info.getEncodedSize()));
  info.encode(message.data(), 0, static_cast<int>(message.size()));
}

}  // namespace

std::filesystem::path part_file(const std::filesystem::path& file, std::int32_t part) {
  if (part == 0) return file;
  std::string number = std::to_string(part);
  if (number.size() < 3) number.insert(0, 3 - number.size(), '0');
  return file.parent_path() / (file.stem().string() + '.' + number + file.extension().string());
}

bool of_one_recording(const recording_info_t& a, const recording_info_t& b) {
  return a.started_utc_us == b.started_utc_us && a.rig == b.rig && a.program == b.program &&
         a.version == b.version && a.configuration_sha256 == b.configuration_sha256 &&
         a.calibration_sha256 == b.calibration_sha256 &&
         a.fault_script_sha256 == b.fault_script_sha256;
}

std::vector<std::string> faults_between(std::span<const LogSurvey> parts) {
  std::vector<std::string> out;
  for (std::size_t i = 1; i < parts.size(); ++i) {
    const LogSurvey& before = parts[i - 1];
    const LogSurvey& part = parts[i];
    if (part.part() == before.part()) {
      out.push_back(named(part) + " and " + before.source + " are the same part");
      continue;
    }
    if (part.part() != before.part() + 1) {
      const bool one = part.part() == before.part() + 2;
      out.push_back("part " + std::to_string(before.part() + 1) +
                    (one ? "" : " to " + std::to_string(part.part() - 1)) + " is missing before " +
                    named(part) + (one ? ": " + part.info->previous_part : std::string()));
      continue;
    }
    const auto start = static_cast<std::uint64_t>(before.info->frames_before);
    if (static_cast<std::uint64_t>(part.info->frames_before) != start + before.frames) {
      out.push_back(named(before) + " has " + physics::counted(before.frames, "frame") + "; " +
                    part.source + " expects " +
                    std::to_string(static_cast<std::uint64_t>(part.info->frames_before) - start));
    }
    if (part.frames == 0 || before.frames == 0) continue;
    if (part.first_time_ns <= before.last_time_ns) {
      out.push_back(named(part) + " begins at " + std::to_string(part.first_time_ns) + " ns, and " +
                    before.source + " ends at " + std::to_string(before.last_time_ns) + " ns");
    }
  }
  return out;
}

JoinResult join_logs(std::span<const std::filesystem::path> files, const std::filesystem::path& out,
                     const ProgressCallback& done) {
  std::error_code none;
  for (const auto& file : files) {
    if (std::filesystem::equivalent(file, out, none)) {
      refuse(out.string(), "is one of the parts; expected another file for the output");
    }
  }
  const std::vector<LogSurvey> parts = parts_of(files, done);
  JoinResult joined;
  joined.parts = parts.size();
  joined.cut_off_bytes = parts.back().cut_off_bytes;
  LogWriter writer(out);
  const auto require = [&out](bool written) {
    if (!written) {
      const int why = errno;
      std::filesystem::remove(out);
      refuse(out.string(), std::string("cannot be written: ") + std::strerror(why));
    }
  };
  const LogSurvey* before = nullptr;
  std::size_t copied = parts.size();  // of twice as many steps: each part was surveyed before
  for (const LogSurvey& part : parts) {
    std::ifstream in(part.source, std::ios::binary);
    EventReader reader(in, part.source, progress_of_part(done, copied++, 2 * parts.size()));
    bool is_first = true;
    for (LogEvent event; reader.next(event) == EventReader::Found::event;) {
      if (event.channel == recording_channel) {
        if (!std::exchange(is_first, false)) {
          take_over_part(*parts.front().info, event.data);
        } else if (before != nullptr) {
          continue;
        }
      }
      require(writer.append(event.channel, event.data, event.time_us));
    }
    joined.frames += part.frames;
    if (before != nullptr && part.frames > 0 && before->frames > 0 &&
        part.first_sequence > before->last_sequence + 1) {
      joined.missing += part.first_sequence - before->last_sequence - 1;
    }
    if (part.frames > 0 || before == nullptr) before = &part;
  }
  require(writer.close());
  return joined;
}

}  // namespace stickslip::protocol
